// The page: one state that comes from the server, drawn; whatever a hand does goes there as a message.
import { $, choices, h, short } from "./dom.js";
import { preview, showGraph, showPreviews } from "./graph.js";
import { showParameters, startParameters } from "./parameters.js";
import { address, showAgainst, showPicture, showPixel, showTexture, startPicture } from "./picture.js";
import { showMemory, showTimes } from "./plan.js";
import { connect, on, send, tell } from "./socket.js";
import "./slider.js";

let pipeline = null;
let state = { edits: {}, flags: [], others: [], pipelines: [] };
let picture = null;
let against = null;
let problems = [];
let node = "";
let still = false;  // a page that was exported: nobody draws anything new
let times = {};       // of the last picture that stood still, by node
const history = [];
const TABS = ["graph", "memory", "times", "changes"];

const act = {
  node(id) { node = id; draw(); },
  port(name) {
    if (still && preview(name)) $("picture").src = preview(name);  // the small one is all that the file holds
    send({ do: "look", port: state.port === name ? "" : name });
  },
};

function draw() {
  const wrong = new Set(problems.map((problem) => problem.node).filter(Boolean));
  if (pipeline) {
    $("name").textContent = pipeline.name;
    $("about").textContent = pipeline.description;
    document.title = `${pipeline.name} – rendergraph`;
    if (!pipeline.nodes[node]) node = "";
    choices($("node"), ["", ...Object.keys(pipeline.nodes)], node, (id) => id || "the pipeline");
    choices($("camera"), ["", ...pipeline.cameras], state.moved ? "" : state.camera ?? pipeline.cameras[0], (name) => name || "moved by hand");
    const ports = pipeline.graph.nodes.flatMap((one) => Object.entries(one.outputs)
      .filter(([, made]) => made.format).map(([name]) => `${one.id}.${name}`));
    const shown = ["", ...pipeline.outputs.slice(1), ...ports];
    if (state.port && !shown.includes(state.port)) shown.push(state.port);
    choices($("port"), shown, state.port ?? "", (name) => name || (pipeline.outputs[0] ?? "image"));
    showParameters($("parameters"), pipeline, node, state.edits);
    showGraph($("graph"), pipeline, { times, culled: pipeline.plan.culled, chosen: node, wrong }, act);
    showMemory($("memory"), pipeline);
  }
  choices($("other"), ["", ...new Set([...state.others, ...state.pipelines])], state.other ?? "", (name) => name || "nothing");
  if (!state.other && against) { against = null; showAgainst({}, {}); }
  $("undo").disabled = !state.can_undo;
  $("redo").disabled = !state.can_redo;
  $("save").disabled = $("copy").disabled = !state.flags.length;
  $("play").setAttribute("aria-pressed", state.playing);
  $("play").textContent = state.playing ? "Pause" : "Play";
  if (document.activeElement !== $("stops")) $("stops").value = state.stops ?? 0;
  $("stops-value").textContent = `${state.stops ?? 0} EV`;
  showTimes($("times"), picture, history);
  showChanges();
  showFigures();
}

function showFrame(number) {
  for (const id of ["frame", "scrub"]) if (document.activeElement !== $(id)) $(id).value = number;
}

function showFigures() {
  if (!picture) return;
  const parts = [`${picture.size.join("×")}`, `${short(Number(picture.frame_ms.toFixed(2)))} ms a frame on ${picture.device.renderer}`];
  if (picture.device.software) parts.push("software: no measure of a GPU");
  if (against?.figures) {
    const { rmse, psnr, ssim, flip } = against.figures;
    parts.push(`against ${against.name}: FLIP ${short(Number(flip.toFixed(4)))}, RMSE ${short(Number(rmse.toFixed(4)))}, PSNR ${psnr === null ? "∞" : short(Number(psnr.toFixed(2)))}, SSIM ${short(Number(ssim.toFixed(4)))}`);
  }
  $("figures").textContent = parts.join("  ·  ");
}

function showProblems(extra = []) {
  const all = [...problems, ...extra];
  $("problems").hidden = all.length === 0;
  $("problems").replaceChildren(...all.map(({ file, line, column, code, text }) => {
    const place = file ? `${file}${line ? `:${line}:${column}` : ""}: ` : "";
    return h("p", { class: "mono" }, `${place}${code} ${text}`);
  }), problems.length && picture ? h("p", {}, "The last good picture stays.") : "");
}

function showChanges() {
  if ($("changes").hidden) return;
  const rows = Object.entries(state.edits).map(([path, value]) => h("tr", {}, h("td", { class: "mono" }, path), h("td", { class: "mono" }, value),
    h("td", {}, h("button", { onclick: () => send({ do: "drop", path }) }, "Take back"))));
  $("changes").replaceChildren(rows.length ? h("table", {}, ...rows) : h("p", { class: "quiet" }, "Nothing is changed."),
    rows.length ? h("pre", {}, flags()) : "");
}

const quoted = (word) => (/^[\w./=@+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);
const flags = () => state.flags.map((flag) => `-s ${quoted(flag)}`).join(" ");

on("state", (facts) => { state = facts; showFrame(facts.frame); showProblems(); draw(); });  // a refusal is past
on("pipeline", (facts) => { pipeline = facts; draw(); });
on("picture", (facts, files) => {
  picture = facts;
  history.push({ ms: facts.frame_ms, passes: facts.passes.filter((pass) => pass.ran) });
  if (history.length > 100) history.shift();
  showFrame(facts.frame);
  showPicture(facts, files);
  showFigures();
  if (!facts.still) return;
  times = Object.fromEntries(facts.passes.map((pass) => [pass.node, pass.gpu_ms ?? pass.cpu_ms]));
  showTexture(facts.texture);
  draw();
});
on("thumbnails", (facts, files) => { showPreviews(files, address); draw(); });
on("against", (facts, files) => { against = files.other ? facts : null; showAgainst(facts, files); showFigures(); });
on("pixel", showPixel);
on("problems", (facts) => { problems = facts.problems; showProblems(); draw(); });
on("refused", (facts) => showProblems(facts.problems));
on("saved", (facts) => {
  if (facts.problems.length) return showProblems(facts.problems);
  showProblems();
  $("link").textContent = `saved ${facts.path}`;
});

function chooseTab(name) {
  for (const tab of TABS) {
    $(tab).hidden = tab !== name;
    $(`tab-${tab}`).setAttribute("aria-selected", tab === name);
    $(`tab-${tab}`).tabIndex = tab === name ? 0 : -1;
  }
  draw();
}

function start() {
  $("undo").onclick = () => send({ do: "undo" });
  $("redo").onclick = () => send({ do: "redo" });
  $("remember").onclick = () => send({ do: "remember" });
  $("frame-all").onclick = () => send({ do: "camera", frame: [] });
  $("camera").onchange = () => { if ($("camera").value) send({ do: "camera", name: $("camera").value }); };
  $("port").onchange = () => send({ do: "look", port: $("port").value });
  $("other").onchange = () => send({ do: "compare", name: $("other").value || null });
  $("node").onchange = () => act.node($("node").value);
  $("stops").oninput = () => send({ do: "look", stops: Number($("stops").value) });
  $("play").onclick = () => send({ do: "play", on: !state.playing });
  $("frame").onchange = () => { if ($("frame").checkValidity()) send({ do: "frame", number: Number($("frame").value) }); };
  $("scrub").oninput = () => send({ do: "frame", number: Number($("scrub").value) });
  const byHand = () => chooseTab("changes");  // where a browser lets no page write there: one from another machine, over HTTP
  $("copy").onclick = () => (navigator.clipboard
    ? navigator.clipboard.writeText(flags()).then(() => { $("link").textContent = "copied"; }, byHand) : byHand());
  $("save").onclick = () => { $("saving").returnValue = ""; $("saving").showModal(); };
  $("saving").onclose = () => { if ($("saving").returnValue === "save") send({ do: "save", name: $("file").value }); };
  TABS.forEach((tab, i) => {
    $(`tab-${tab}`).onclick = () => chooseTab(tab);
    $(`tab-${tab}`).onkeydown = (event) => {
      const move = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!move) return;
      const next = TABS[(i + move + TABS.length) % TABS.length];
      chooseTab(next);
      $(`tab-${next}`).focus();
    };
  });
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || event.target.matches("input[type=text]")) return;
    event.preventDefault();
    send({ do: event.shiftKey ? "redo" : "undo" });
  });
  startPicture();
  startParameters($("parameters"));
  chooseTab("graph");
  const kept = $("kept");  // a page that was exported holds what it shows
  if (!kept) return connect();
  still = true;
  for (const { kind, facts, files } of JSON.parse(kept.textContent)) tell(kind, facts, files);
  $("link").textContent = "a still page: what it shows is in this file";
  for (const input of document.querySelectorAll("header button, #left .bar :is(button, select, input)")) input.disabled = true;
  $("parameters").disabled = true;
}

start();
