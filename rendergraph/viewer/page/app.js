// The page: shows the state that comes from the server, and sends every action there as a message.
import { $, choices, h, short } from "./dom.js";
import { showEditor, showTypes, startEditor, takeAdded } from "./editor.js";
import { fold, scopesOf } from "./fold.js";
import { preview, reveal, showGraph, showPreviews, startGraph } from "./graph.js";
import { showParameters, startParameters } from "./parameters.js";
import { address, showComparison, showLooking, showPicture, showPixel, showSmall, showTexture, startPicture } from "./picture.js";
import { showMemory, showTimes } from "./plan.js";
import { startLayout } from "./layout.js";
import { connect, dispatch, on, send } from "./socket.js";
import "./slider.js";

let pipeline = null;
let state = { edits: {}, flags: [], others: [], pipelines: [] };
let picture = null;
let comparison = null;
let problems = [];
let node = "";
let link = null;      // the chosen link, with its words
let saved = "";       // the name that was last saved under
let draft = null;     // what saving would write, and the digest of what it replaces
let still = false;  // an exported page renders nothing new
let times = {};       // of the last still picture, by node
const opened = new Set();  // the sub-pipelines that are open
let folds = false;         // what the file inherits is one card for each file
const history = [];
const MOST_PROBLEMS = 3;  // that are shown at once
const TABS = ["graph", "memory", "times", "changes"];

const act = {
  node(id) { if (node !== id) $("right").scrollTop = 0; node = id; link = null; draw(); },
  open(scope) {
    if (scope.startsWith("from ")) folds = false;
    else opened.add(scope);
    draw();
  },
  link(found, words) { link = link?.words === words ? null : { ...found, words }; draw(); },
  enable(name) { send({ do: "set", path: `${name}.enabled`, value: true }); },
  port(name) {
    if (still && preview(name)) showSmall(name, preview(name));  // an exported page holds only the small one
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
    if (!pipeline.graph.links.some((one) => link && ["source", "source_port", "target", "target_port"].every((name) => one[name] === link[name]))) link = null;
    choices($("node"), ["", ...Object.keys(pipeline.nodes)], node, (id) => id || "the pipeline");
    choices($("camera"), ["", ...pipeline.cameras], state.moved ? "" : state.camera ?? pipeline.cameras[0], (name) => name || "moved by hand");
    const ports = pipeline.graph.nodes.flatMap((one) => Object.entries(one.outputs)
      .filter(([, output]) => output.format).map(([name]) => `${one.id}.${name}`));
    const shown = ["", ...pipeline.outputs.slice(1), ...ports];
    const port = (state.port ?? "").split("[")[0];  // without layer and mip
    if (!shown.includes(port)) shown.push(port);
    choices($("port"), shown, port, (name) => name || (pipeline.outputs[0] ?? "image"));
    const { camera, frame, ...settings } = state.edits;  // a camera that moves leaves the fields alone
    const { scenes, environments } = state;
    showParameters($("parameters"), pipeline, node, settings, { scenes, environments });
    const bases = Object.fromEntries(Object.entries(pipeline.nodes).filter(([, one]) => one.base).map(([id, one]) => [id, one.base]));
    const reused = new Set((picture?.passes ?? []).filter((pass) => !pass.ran).map((pass) => pass.node));
    showGraph($("canvas"), { ...pipeline, graph: fold(pipeline.graph, opened, folds ? bases : {}) }, { times, reused, culled: pipeline.plan.culled, chosen: node, link: link?.words, wrong }, act);
    $("inherited").hidden = !Object.keys(bases).length;
    $("inherited").setAttribute("aria-pressed", folds);
    showEditor(pipeline, node, link);
    showLooking(pipeline, state);
    $("fold").hidden = !opened.size;
    showMemory($("memory"), pipeline);
  }
  choices($("other"), ["", ...new Set([...state.others, ...state.pipelines])], state.other ?? "", (name) => name || "nothing");
  if (!state.other && comparison) { comparison = null; showComparison({}, {}); }
  $("undo").disabled = !state.can_undo;
  $("redo").disabled = !state.can_redo;
  $("save").disabled = !state.is_rewired && !Object.keys(state.edits).length;
  $("copy").disabled = !state.flags.length;
  $("play").setAttribute("aria-pressed", state.playing);
  $("play").textContent = state.playing ? "Pause" : "Play";
  if (document.activeElement !== $("exposure")) $("exposure").value = state.exposure_ev ?? 0;
  $("exposure-value").textContent = `${state.exposure_ev ?? 0} EV`;
  showTimes($("times"), picture, history);
  showChanges();
  showFigures();
}

function showFrame(number) {
  for (const id of ["frame", "scrub"]) if (document.activeElement !== $(id)) $(id).value = number;
}

function showFigures() {
  if (!picture) return;
  const parts = [`${picture.size.join("×")}`, `${short(Number(picture.frame_ms.toFixed(2)))} ms per frame on ${picture.device.renderer}`];
  if (picture.revision < state.revision && !problems.length) parts.push("drawing…");
  if (picture.device.software) parts.push("software rasteriser, not a GPU measurement");
  if (comparison?.figures) {
    const { rmse, psnr, ssim, flip } = comparison.figures;
    parts.push(`against ${comparison.name}: FLIP ${short(Number(flip.toFixed(4)))}, RMSE ${short(Number(rmse.toFixed(4)))}, PSNR ${psnr === null ? "∞" : short(Number(psnr.toFixed(2)))}, SSIM ${short(Number(ssim.toFixed(4)))}`);
  }
  $("figures").textContent = parts.join("  ·  ");
}

function showProblems(extra = []) {
  const all = [...problems, ...(picture?.warnings ?? []), ...extra];
  $("problems").hidden = all.length === 0 && !state.is_behind;
  const lines = all.map(({ file, line, column, code, text, node: at }) => {
    const place = file ? `${file}${line ? `:${line}:${column}` : ""}: ` : "";
    const choose = pipeline?.nodes[at] ? h("button", { onclick: () => act.node(at) }, `Choose ${at}`) : "";
    return h("p", { class: "mono" }, `${place}${code} ${text} `, choose);
  });
  const more = lines.splice(MOST_PROBLEMS);
  $("problems").replaceChildren(...lines, more.length ? h("details", {}, h("summary", {}, `${more.length} more`), ...more) : "", problems.length && picture ? h("p", {}, "Showing the last good picture.") : "",
  state.is_behind ? h("p", {}, `${state.file} has changed on disk since it was changed here. “Save as…” shows what it would overwrite. `,
    h("button", { onclick: () => send({ do: "reload" }) }, "Discard my changes and reload the file")) : "");
}

function showChanges() {
  if ($("changes").hidden) return;
  const rows = Object.entries(state.edits).map(([path, value]) => h("tr", {}, h("td", { class: "mono" }, path), h("td", { class: "mono" }, value),
    h("td", {}, h("button", { onclick: () => send({ do: "drop", path }) }, "Revert"))));
  const none = !rows.length && !state.is_rewired;
  $("changes").replaceChildren(none ? h("p", { class: "quiet" }, "No changes.") : h("table", {}, ...rows),
    state.flags.length ? h("pre", {}, flags()) : "", state.is_rewired && draft ? h("pre", {}, draft.difference) : "");
}

function askDraft() {
  const isOwn = state.is_own && $("file").value === state.file;
  $("saving-note").textContent = isOwn || !state.is_own ? "" : `A new file holds only the differences to ${state.file}, which it extends.`;
  if ($("saving").open) send({ do: "draft", name: $("file").value });
  else if (!$("changes").hidden && state.is_rewired) send({ do: "draft" });
}

const quote = (word) => (/^[\w./=@+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);
const flags = () => [...state.flags.map((flag) => `-s ${quote(flag)}`), ...(state.edits.frame ? [`--frames ${state.edits.frame}-${state.edits.frame}`] : [])].join(" ");

on("state", (facts) => { state = facts; showFrame(facts.frame); showProblems(); draw(); });  // clears a refusal
on("pipeline", (facts) => {
  pipeline = facts;
  const added = takeAdded(pipeline.nodes);
  node = added || node;
  draw();
  if (added) setTimeout(() => reveal($("canvas"), added), 300);  // once it is laid out
});
on("picture", (facts, files) => {
  picture = facts;
  comparison = null;  // it is of another picture; that with a still one follows
  history.push({ ms: facts.frame_ms, passes: facts.passes.filter((pass) => pass.ran) });
  if (history.length > 100) history.shift();
  showFrame(facts.frame);
  showProblems();
  showPicture(facts, files);
  $("mapping").textContent = facts.mapping;
  $("exposure-label").hidden = !facts.is_light;
  showFigures();
  if (!facts.still) return;
  times = Object.fromEntries(facts.passes.map((pass) => [pass.node, pass.gpu_ms ?? pass.cpu_ms]));
  showTexture(facts.texture);
  draw();
  askDraft();
});
on("thumbnails", (facts, files) => { showPreviews(files, address); draw(); });
on("against", (facts, files) => {
  if (facts.revision !== undefined && facts.revision !== picture?.revision) return;  // of another picture
  comparison = files.other ? facts : null;
  showComparison(facts, files);
  showFigures();
});
on("pixel", (facts) => { if (facts.revision === picture?.revision) showPixel(facts); });
on("problems", (facts) => { problems = facts.problems; showProblems(); draw(); });
on("refused", (facts) => {
  if ($("saving").open) {
    $("draft").textContent = facts.problems.map((problem) => problem.text).join("\n");
    $("saving-now").disabled = true;
  } else showProblems(facts.problems);
});
on("saved", (facts) => {
  saved = facts.path;
  $("link").textContent = `saved ${facts.path}${state.edits.frame ? "; draw this frame with --view page" : ""}`;
});
on("draft", (facts) => { draft = facts; $("saving-now").disabled = false; $("draft").textContent = facts.difference || "no difference"; showChanges(); });
on("notes", (facts) => { $("link").textContent = facts.notes.join("; "); });
on("types", showTypes);

function chooseTab(name) {
  for (const tab of TABS) {
    $(tab).hidden = tab !== name;
    $(`tab-${tab}`).setAttribute("aria-selected", tab === name);
    $(`tab-${tab}`).tabIndex = tab === name ? 0 : -1;
  }
  draw();
  askDraft();
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
  $("exposure").oninput = () => send({ do: "look", exposure: Number($("exposure").value) });
  $("play").onclick = () => send({ do: "play", on: !state.playing });
  $("frame").onchange = () => { if ($("frame").checkValidity()) send({ do: "frame", number: Number($("frame").value) }); };
  $("scrub").oninput = () => send({ do: "frame", number: Number($("scrub").value) });
  const byHand = () => chooseTab("changes");  // browsers deny the clipboard to pages of other machines over HTTP
  $("copy").onclick = () => (navigator.clipboard
    ? navigator.clipboard.writeText(flags()).then(() => { $("link").textContent = "copied"; }, byHand) : byHand());
  $("save").onclick = () => {
    $("saving").returnValue = "";
    $("file").value = saved || state.file;
    $("saving").showModal();
    askDraft();
  };
  $("file").oninput = () => { if ($("file").checkValidity()) askDraft(); };
  $("saving").onclose = () => {
    if ($("saving").returnValue === "save") send({ do: "save", name: $("file").value, digest: draft?.name === $("file").value ? draft.digest : "" });
  };
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
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || event.target.matches("input[type=text], input[type=search]")) return;
    event.preventDefault();
    send({ do: event.shiftKey ? "redo" : "undo" });
  });
  startLayout();
  startPicture();
  $("inherited").onclick = () => { folds = !folds; draw(); };
  $("fold").onclick = () => { opened.clear(); draw(); };
  startEditor((id) => {
    for (const scope of scopesOf(id)) opened.add(scope);
    folds = folds && !pipeline.nodes[id]?.base;
    act.node(id);
    setTimeout(() => reveal($("canvas"), id), 300);  // the layout may be another
  }, (words) => { $("link").textContent = words; });
  startGraph($("canvas"), [[$("zoom-out"), 0.8], [$("zoom-in"), 1.25], [$("zoom-fit"), 0]]);
  startParameters($("parameters"));
  chooseTab("graph");
  const exported = $("exported");  // an exported page holds its messages
  if (!exported) return connect();
  still = true;
  for (const { kind, facts, files } of JSON.parse(exported.textContent)) dispatch(kind, facts, files);
  $("link").textContent = "a static page: everything is in this file";
  for (const input of document.querySelectorAll("header button, #left .bar :is(button, select, input), #graph-bar > button")) input.disabled = true;
  $("parameters").disabled = true;
}

start();
