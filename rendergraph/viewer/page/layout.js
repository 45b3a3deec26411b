// The parts of a wide page: their sizes, and one of them alone.
import { $ } from "./dom.js";

// A line behind a part: dragged, or moved by arrow keys. `change` gets the share of the part in the window in percent.
function separator(line, part, across, change) {
  const set = (share) => {
    const value = Math.round(Math.min(80, Math.max(20, share)));
    line.setAttribute("aria-valuenow", value);
    change(value);
  };
  line.addEventListener("pointerdown", (event) => {
    line.setPointerCapture(event.pointerId);
    const at = (now) => (across ? now.clientX : now.clientY);
    const other = at(event) - (across ? part.clientWidth : part.clientHeight);  // what stands before the part
    const move = (now) => set((100 * (at(now) - other)) / (across ? innerWidth : innerHeight));
    line.addEventListener("pointermove", move);
    line.addEventListener("lostpointercapture", () => line.removeEventListener("pointermove", move), { once: true });
  });
  line.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -2, ArrowUp: -2, ArrowRight: 2, ArrowDown: 2 }[event.key];
    if (!step) return;
    event.preventDefault();
    set(Number(line.getAttribute("aria-valuenow")) + step);
  });
}

const isTyping = (target) => target.matches("input:not([type=range], [type=checkbox]), select, textarea");

export function startLayout() {
  const resized = () => dispatchEvent(new Event("resize"));  // the picture fits itself
  separator($("split"), $("left"), true, (share) => { document.body.style.setProperty("--left", `${share}%`); resized(); });
  separator($("split-below"), $("stage"), false, (share) => { document.body.style.setProperty("--picture", share / 100); resized(); });
  $("keys").onclick = () => $("shortcuts").showModal();
  document.addEventListener("keydown", (event) => {
    if (event.key === "?" && !isTyping(event.target) && !document.querySelector("dialog[open]")) return $("shortcuts").showModal();
    const part = { g: "graph-alone", p: "picture-alone" }[event.key];
    if (!part || event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target) || document.querySelector("dialog[open]")) return;
    const on = !document.body.classList.contains(part);
    document.body.classList.remove("graph-alone", "picture-alone");
    document.body.classList.toggle(part, on);
    resized();
  });
}
