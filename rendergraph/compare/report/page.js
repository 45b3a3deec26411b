// The A/B viewer: two of the page's own pictures, cut by a slider, or their difference. Nothing is fetched.
"use strict";
(() => {
  const viewer = document.querySelector(".viewer");
  if (!viewer) return;
  const find = (name) => viewer.querySelector(`[data-${name}]`);
  const selects = { a: find("a"), b: find("b") };
  const slider = find("slider"), gain = find("gain"), zoom = find("zoom"), readout = find("readout");
  const stage = find("stage"), frame = find("frame"), under = find("under"), over = find("over");
  const canvas = find("canvas"), cut = find("cut"), left = find("left"), right = find("right");
  const buttons = [...viewer.querySelectorAll("[data-mode]")];
  const texels = new Map();
  let mode = "slide";

  const picture = (side) => document.getElementById(selects[side].value);
  const label = (side) => selects[side].selectedOptions[0].textContent;

  // Decoded pixels of a picture, kept: reading them back is slow.
  function pixels(image) {
    if (!texels.has(image.id)) {
      const sheet = document.createElement("canvas");
      sheet.width = image.naturalWidth;
      sheet.height = image.naturalHeight;
      const context = sheet.getContext("2d", { willReadFrequently: true });
      context.drawImage(image, 0, 0);
      texels.set(image.id, context.getImageData(0, 0, sheet.width, sheet.height));
    }
    return texels.get(image.id);
  }

  function difference() {
    const a = pixels(picture("a")), b = pixels(picture("b"));
    canvas.width = a.width;
    canvas.height = a.height;
    const context = canvas.getContext("2d"), out = context.createImageData(a.width, a.height);
    const factor = Number(gain.value);
    for (let i = 0; i < out.data.length; i += 4) {
      for (let channel = 0; channel < 3; ++channel) {
        out.data[i + channel] = Math.abs(a.data[i + channel] - b.data[i + channel]) * factor;
      }
      out.data[i + 3] = 255;
    }
    context.putImageData(out, 0, 0);
  }

  // A picture that is fitted fills the page, but small ones are not blown up beyond recognition.
  function resize() {
    const width = picture("a").naturalWidth, whole = zoom.value === "fit";
    const scale = whole ? Math.max(1, Math.floor(800 / width)) : Number(zoom.value);
    viewer.classList.toggle("pixels", scale > 1);
    frame.parentElement.style.width = whole ? `min(100% - 16px, ${width * scale}px)` : `${width * scale}px`;
  }

  function show() {
    under.src = picture("b").src;
    over.src = picture("a").src;
    under.alt = label("b");
    over.alt = label("a");
    left.textContent = mode === "difference" ? `|A − B| × ${gain.value}` : mode === "b" ? `B ${label("b")}` : `A ${label("a")}`;
    right.textContent = `B ${label("b")}`;
    right.hidden = mode !== "slide";
    cut.hidden = mode !== "slide";
    slider.disabled = mode !== "slide";
    canvas.hidden = mode !== "difference";
    over.hidden = mode === "b";
    if (mode === "difference") difference();
    for (const button of buttons) button.setAttribute("aria-pressed", String(button.dataset.mode === mode));
    resize();
    move();
  }

  function move() {
    const part = mode === "slide" ? Number(slider.value) : 100;
    over.style.clipPath = `inset(0 ${100 - part}% 0 0)`;
    cut.style.left = `${part}%`;
    slider.setAttribute("aria-valuetext", `${Math.round(part)} % A`);
  }

  function choose(next) {
    mode = next;
    show();
  }

  // The slider follows the pointer over the picture, and the read-out says what lies under it.
  function follow(event) {
    const box = frame.getBoundingClientRect();
    const u = (event.clientX - box.left) / box.width, v = (event.clientY - box.top) / box.height;
    if (u < 0 || u >= 1 || v < 0 || v >= 1) return;
    if (mode === "slide" && (event.buttons & 1 || event.type === "pointerdown")) {
      slider.value = String(u * 100);
      move();
    }
    const a = pixels(picture("a")), b = pixels(picture("b"));
    const x = Math.floor(u * a.width), y = Math.floor(v * a.height), at = 4 * (y * a.width + x);
    const values = (data) => `${data[at]} ${data[at + 1]} ${data[at + 2]}`;
    readout.textContent = `x ${x}  y ${y}   A ${values(a.data)}   B ${values(b.data)}`;
  }

  for (const select of Object.values(selects)) select.addEventListener("change", show);
  slider.addEventListener("input", move);
  gain.addEventListener("change", () => choose("difference"));
  zoom.addEventListener("change", resize);
  for (const button of buttons) button.addEventListener("click", () => choose(button.dataset.mode));
  frame.addEventListener("pointermove", follow);
  frame.addEventListener("pointerdown", follow);
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
    const keys = { a: "a", b: "b", s: "slide", d: "difference" };
    if (event.key === "x") choose(mode === "a" ? "b" : "a");
    else if (keys[event.key]) choose(keys[event.key]);
  });
  for (const button of document.querySelectorAll("[data-compare]")) {
    button.addEventListener("click", () => {
      selects.b.value = button.dataset.compare;
      show();
      viewer.scrollIntoView({ block: "start" });
    });
  }
  // Paper has nothing to open.
  const folded = [...document.querySelectorAll("details")];
  window.addEventListener("beforeprint", () => folded.forEach((one) => { one.dataset.was = one.open; one.open = true; }));
  window.addEventListener("afterprint", () => folded.forEach((one) => { one.open = one.dataset.was === "true"; }));
  stage.hidden = false;
  Promise.all([picture("a").decode(), picture("b").decode()]).then(show);
})();
