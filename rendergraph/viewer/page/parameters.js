// Input fields for a node, made from the declaration of its type.
import { h } from "./dom.js";
import { outputsFor, readersOf } from "./editor.js";
import { send } from "./socket.js";

let held = null;     // the setting that a slider or a colour picker is moving: all of that is one step of undo
let writing = null;  // the field that is being typed in
let shown = { values: [], keptRow: null, newRow: null };  // the values that the fields show, the row that was not replaced, and its replacement

const ROLES = { define: "A change compiles its shader again.", structural: "A change plans the pipeline again." };

const set = (path, value) => {
  send({ do: "set", path, value, again: held === path });
  if (held !== null) held = path;
};

const hold = () => { held ??= ""; send({ do: "hold", on: true }); };
const release = () => { if (held !== null) { held = null; send({ do: "hold", on: false }); } };

// The edited value, which the pipeline has only after the next picture, or never where it is wrong.
function editedValue(edits, path, value) {
  if (!(path in edits)) return value;
  try {
    return JSON.parse(edits[path]);
  } catch {
    return edits[path];  // a word
  }
}

const asHex = (color) => "#" + color.map((x) => {
  const curve = x <= 0.0031308 ? x * 12.92 : 1.055 * x ** (1 / 2.4) - 0.055;
  return Math.round(Math.min(1, Math.max(0, curve)) * 255).toString(16).padStart(2, "0");
}).join("");

const asColor = (hex) => [1, 3, 5].map((at) => {
  const x = parseInt(hex.slice(at, at + 2), 16) / 255;
  return Number((x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4).toFixed(4));
});

// Round a step down to 1, 2 or 5 times a power of ten, so that it meets round defaults.
function roundStep(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  return (([5, 2].find((many) => many * power <= step) ?? 1) * power).toPrecision(1);
}

function numberField(path, id, about) {
  const step = about.kind === "integer" ? 1 : "any";
  const limits = { min: about.min, max: about.max, step };
  const number = h("input", { type: "number", id, value: about.value, ...limits });
  number.addEventListener("change", () => {
    if (number.value !== "" && number.checkValidity()) set(path, Number(number.value));
    else number.reportValidity();
  });
  number.addEventListener("blur", () => { if (number.value === "" || !number.checkValidity()) number.value = about.value; });
  const fields = [number];
  if (about.min !== null || about.kind === "number") {
    // Of an unbounded range, or one that is wide beside its default, the part around that is shown.
    const usual = Math.max(Math.abs(about.default ?? about.value), Math.abs(about.value), about.kind === "integer" ? 8 : 0.5);
    const isNarrow = about.min !== null && about.max !== null && about.max - about.min <= Math.max(20 * usual, 2);
    const least = about.min === null || about.min < 0 ? -8 * usual : 0;
    const low = isNarrow ? about.min : Math.max(about.min ?? Math.min(0, about.value, about.default ?? 0), least);
    const high = isNarrow ? about.max : Math.min(about.max ?? Infinity, Math.max(low, 0) + 8 * usual);
    const grain = about.kind === "integer" ? 1 : roundStep((high - low) / 200);
    const range = h("input", {
      type: "range", id: `${id}-slider`, min: low, max: high, step: grain, value: about.value, "aria-label": `${path}, slider`,
    });
    range.addEventListener("pointerdown", ({ button }) => { if (button === 0) hold(); });  // other buttons move nothing
    range.addEventListener("input", () => { number.value = range.value; set(path, Number(range.value)); });
    for (const end of ["pointerup", "pointercancel", "change"]) range.addEventListener(end, release);
    fields.unshift(range);
  }
  return fields;
}

function colorField(path, id, about) {
  const color = Array.isArray(about.value) ? about.value : [about.value, about.value, about.value];
  const wheel = h("input", { type: "color", id, value: asHex(color) });
  wheel.addEventListener("input", () => {
    if (held === null) hold();
    const chosen = asColor(wheel.value);
    parts.forEach((part, i) => { part.value = chosen[i]; });
    set(path, chosen);
  });
  for (const end of ["change", "blur"]) wheel.addEventListener(end, release);
  const parts = color.map((part, i) => {
    const name = "RGB"[i];
    const limits = { min: about.min, max: about.max, step: "any" };
    const field = h("input", { type: "number", id: `${id}-${name}`, ...limits, value: part, "aria-label": `${path}, ${name}` });
    field.addEventListener("change", () => {
      if (field.value !== "" && field.checkValidity()) set(path, parts.map((one) => Number(one.value)));
      else field.reportValidity();
    });
    return field;
  });
  return [wheel, ...parts];
}

function field(path, id, about) {
  if (about.kind === "choice") {
    const select = h("select", { id, onchange: () => set(path, about.choices.find((c) => String(c) === select.value)) },
      ...about.choices.map((choice) => h("option", { value: String(choice) }, String(choice))));
    select.value = String(about.value);
    return [select];
  }
  if (about.kind === "boolean") {
    const box = h("input", { type: "checkbox", id, onchange: () => set(path, box.checked) });
    box.checked = about.value;
    return [box];
  }
  if (about.kind === "number" || about.kind === "integer") return numberField(path, id, about);
  if (about.kind === "color") return colorField(path, id, about);
  const text = h("input", {
    type: "text", id, value: about.kind === "text" ? about.value : JSON.stringify(about.value),
    onchange: () => {
      if (about.kind === "text") return set(path, text.value);
      try {
        set(path, JSON.parse(text.value));
        text.setCustomValidity("");
      } catch {
        text.setCustomValidity("JSON, as in [1, 2, 3]");
        text.reportValidity();
      }
    },
  });
  return [text];
}

function row(path, label, about, changed, fields) {
  const id = `p-${path}`;
  const back = changed
    ? h("button", { class: "back", title: "Revert the change", "aria-label": `Revert ${path}`, onclick: () => send({ do: "drop", path }) }, "↺")
    : h("span");
  const idle = about.idle && `Has no effect while ${about.idle} is connected.`;
  const tip = [idle, about.doc, about.takes && `Expects ${about.takes}.`, ROLES[about.role]].filter(Boolean).join(" ").replaceAll("`", "");
  return h("div", { class: `parameter${changed ? " set" : ""}${idle ? " idle" : ""}`, title: tip, "data-path": path },
    h("span", {}, h("label", { for: id }, label)),
    h("span", { class: "field" }, ...fields, about.unit ? h("span", { class: "quiet" }, about.unit) : null), back);
}

function setting(path, label, about, edits) {
  const now = { ...about, value: editedValue(edits, path, about.value) };
  return row(path, label, about, path in edits, field(path, `p-${path}`, now));
}

function linkRow(graph, node, name, about, edits) {
  const path = `${node}.${name}`;
  const links = [editedValue(edits, path, about.links)].flat().filter(Boolean);
  const words = [...new Set([...(about.optional || about.many ? [""] : []), ...links, ...outputsFor(graph, about, readersOf(node, graph))])];
  // An input for several links has a list for each, and one more to add another.
  const now = about.many ? [...links, ""] : [links[0] ?? ""];
  const lists = now.map((link, at) => {
    const list = h("select", { id: at ? `p-${path}-${at}` : `p-${path}`, "aria-label": at ? `${path}, ${at + 1}` : null, onchange: () => {
      const next = now.with(at, list.value).filter(Boolean);
      set(path, about.many && next.length ? next : next[0] ?? null);
    } }, ...words.map((word) => h("option", { value: word }, word || (links.length && at === links.length ? "add another" : "nothing"))));
    list.value = link;
    return list;
  });
  return row(path, name, about, path in edits, lists);
}

// The types of a node: those that fit its links, and the others.
function typeField(node, about, edits) {
  const options = (words) => words.map((word) => h("option", { value: word }, word));
  const others = about.other_types.filter((word) => word !== about.type);
  const types = h("select", { id: `p-${node}.type`, onchange: () => set(`${node}.type`, types.value) },
    ...options([...new Set([about.type, ...about.types])]),
    others.length ? h("optgroup", { label: "need other links" }, ...options(others)) : null);
  types.value = editedValue(edits, `${node}.type`, about.type);
  return types;
}

// The nodes that have alternatives, each with a list of them.
const techniques = (pipeline, edits) => Object.entries(pipeline.nodes).filter(([, about]) => about.types.length > 1)
  .map(([node, about]) => row(`${node}.type`, node, { doc: about.doc }, `${node}.type` in edits, [typeField(node, about, edits)]));

// What is drawn, by which light and seen from where.
function surroundings(pipeline, edits, { scenes = [], environments = [] }) {
  const chooser = (path, names, value, doc) => {
    const now = editedValue(edits, path, value);
    const list = h("select", { id: `p-${path}`, onchange: () => (list.value ? set(path, list.value) : send({ do: "drop", path })) },
      ...[...new Set([path === "scene" ? now : "", now, ...names])].map((name) => h("option", { value: name }, name || "the scene's own")));
    list.value = now;
    return row(path, path, { doc }, path in edits, [list]);
  };
  const view = h("select", { id: "p-view", onchange: () => { if (view.value) send({ do: "view", name: view.value }); } },
    ...["", ...pipeline.views].map((name) => h("option", { value: name }, name || (pipeline.views.length ? "choose" : "none is kept"))));
  const keep = h("button", { onclick: () => {
    const name = document.getElementById("p-view-name");
    name.required = true;  // only now: an empty field is no mistake before
    if (name.reportValidity()) send({ do: "keep_view", name: name.value });
  } }, "Keep view");
  const name = h("input", { type: "text", id: "p-view-name", size: 8, pattern: "[A-Za-z_][A-Za-z0-9_\\-]*", title: "A letter or _, then letters, digits, _ or -", placeholder: "name", "aria-label": "Name of the view to keep" });
  return [
    chooser("scene", scenes, pipeline.scene, "What is drawn."),
    chooser("environment", environments, pipeline.environment, "The light from all around."),
    row("view", "view", { doc: "Camera, frame and environment, kept in the file under a name." }, false, [view]),
    row("view-name", "", {}, false, [name, keep]),
  ];
}

// The parameters and inputs of a node, or those of the pipeline where no node is chosen.
export function showParameters(container, pipeline, node, edits, surrounding = {}) {
  // A field that is being typed in stays. A drag ends and a colour picker closes when elements around them change, so
  // both wait.
  if (held !== null) return;
  const keptRow = writing && container.contains(writing) ? writing.closest(".parameter") : null;
  const values = [pipeline, node, JSON.stringify([edits, surrounding])];
  if (values.every((value, i) => value === shown.values[i]) && (shown.keptRow === null || shown.keptRow === keptRow)) return;
  shown = { values, keptRow, newRow: null };
  if (container.dataset.node !== node) document.getElementById("help").textContent = "";  // it is of another node
  container.dataset.node = node;
  const focused = document.activeElement?.id;
  const parts = [];
  const about = pipeline.nodes[node];
  if (!about) {
    const own = Object.entries(pipeline.parameters);
    parts.push(h("p", { class: "doc" }, own.length ? "Parameters of the pipeline." : "Choose a node, here or in the graph, for its parameters."));
    for (const [name, found] of own) parts.push(setting(name, name, found, edits));
    parts.push(h("h2", {}, "Techniques"), ...techniques(pipeline, edits));
    parts.push(h("h2", {}, "Surroundings"), ...surroundings(pipeline, edits, surrounding));
  } else {
    const types = typeField(node, about, edits);
    const enabled = h("input", { type: "checkbox", id: `p-${node}.enabled`, onchange: () => set(`${node}.enabled`, enabled.checked) });
    enabled.checked = editedValue(edits, `${node}.enabled`, true);
    parts.push(h("p", { class: "doc" }, about.doc));
    parts.push(row(`${node}.type`, "type", {}, `${node}.type` in edits, [types]));
    parts.push(row(`${node}.enabled`, "enabled", {}, `${node}.enabled` in edits, [enabled]));
    const parameters = Object.entries(about.parameters);
    if (parameters.length) parts.push(h("h2", {}, "Parameters"));
    for (const [name, found] of parameters) parts.push(setting(`${node}.${name}`, name, found, edits));
    const inputs = Object.entries(about.inputs);
    if (inputs.length) parts.push(h("h2", {}, "Inputs"));
    for (const [name, found] of inputs) parts.push(linkRow(pipeline.graph, node, name, found, edits));
  }
  for (const name of pipeline.disabled) {
    const button = h("button", { onclick: () => set(`${name}.enabled`, true) }, "enable");
    parts.push(h("p", {}, `${name} is disabled `, button));
  }
  const at = keptRow ? parts.findIndex((part) => part.dataset.path === keptRow.dataset.path) : -1;
  if (at < 0) container.replaceChildren(...parts);
  else {  // moving a row would take the focus from it, so the others are placed around it
    shown.newRow = parts[at];
    for (const other of [...container.children]) if (other !== keptRow) other.remove();
    keptRow.before(...parts.slice(0, at));
    keptRow.after(...parts.slice(at + 1));
    return;
  }
  if (!focused?.startsWith("p-")) return;
  const again = document.getElementById(focused);
  again?.focus({ preventScroll: true });
  if (again?.matches("input[type=number], input[type=text]")) again.select();  // as after Tab
}

// A field counts as being typed in from the first letter until its change or blur.
export function startParameters(container) {
  // What a row is for is also said below, where touch and the keyboard reach it.
  const explain = ({ target }) => { document.getElementById("help").textContent = target.closest(".parameter")?.title ?? ""; };
  for (const kind of ["focusin", "pointerdown", "pointerover"]) container.addEventListener(kind, explain);
  container.addEventListener("input", ({ target }) => { if (target.matches("input[type=number], input[type=text]")) writing = target; });
  container.addEventListener("change", () => { writing = shown.newRow = null; });  // the typed value is newer
  container.addEventListener("focusout", ({ relatedTarget }) => {
    writing = null;
    const { keptRow, newRow } = shown;
    if (!newRow || keptRow.contains(relatedTarget)) return;
    shown.keptRow = shown.newRow = null;
    keptRow.replaceWith(newRow);  // only this row: the next click may be on another one
  });
}
