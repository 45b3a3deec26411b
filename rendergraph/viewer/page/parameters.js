// Inputs for a node: made from what its type declares.
import { h } from "./dom.js";
import { send } from "./socket.js";

let held = null;     // the setting that a slider or a colour's window is moving, so that its way is one step of undo
let writing = null;  // the field that somebody is writing in
let drawn = { made: [], kept: null, fresh: null };  // what the inputs were made of, the row that stayed, and how it would be

const set = (path, value) => {
  send({ do: "set", path, value, again: held === path });
  if (held !== null) held = path;
};

const hold = () => { held ??= ""; send({ do: "hold", on: true }); };
const release = () => { if (held !== null) { held = null; send({ do: "hold", on: false }); } };

// What a setting is since it was changed, which the pipeline says after the next picture, or never where it is wrong.
function since(edits, path, value) {
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

// One, two or five of a power of ten: steps that meet the round numbers a default is.
function even(step) {
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
  const fields = [number];
  if (about.min !== null || about.kind === "number") {
    // A range that nobody bounds is shown around its default.
    const low = about.min ?? Math.min(0, about.value, about.default ?? 0);
    const wide = Math.max(Math.abs(about.default ?? about.value), Math.abs(about.value), about.kind === "integer" ? 8 : 0.5) * 4;
    const high = about.max !== null && about.max - low <= 128 ? about.max : Math.min(about.max ?? Infinity, low + wide);
    const grain = about.kind === "integer" ? 1 : even((high - low) / 200);
    const range = h("input", {
      type: "range", id: `${id}-slider`, min: low, max: high, step: grain, value: about.value, "aria-label": `${path}, slider`,
    });
    range.addEventListener("pointerdown", ({ button }) => { if (button === 0) hold(); });  // others move nothing
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
    ? h("button", { class: "back", title: "Take the change back", "aria-label": `Take back ${path}`, onclick: () => send({ do: "drop", path }) }, "↺")
    : h("span");
  const idle = about.idle && `Nothing looks at it while ${about.idle} is connected.`;
  const tip = [idle, about.doc, about.takes && `Takes ${about.takes}.`, about.role && `(${about.role})`].filter(Boolean).join(" ");
  return h("div", { class: `parameter${changed ? " set" : ""}${idle ? " idle" : ""}`, title: tip, "data-path": path },
    h("span", {}, h("label", { for: id }, label)),
    h("span", { class: "field" }, ...fields, about.unit ? h("span", { class: "quiet" }, about.unit) : null), back);
}

function setting(path, label, about, edits) {
  const now = { ...about, value: since(edits, path, about.value) };
  return row(path, label, about, path in edits, field(path, `p-${path}`, now));
}

// Outputs that an input takes, of nodes that do not wait for its own: first those that mean just that.
function fitting(graph, node, about) {
  const readers = new Map();
  for (const { source, target, previous } of graph.links) {
    if (!previous) readers.set(source, [...(readers.get(source) ?? []), target]);
  }
  const after = new Set([node]);
  for (const one of after) for (const reader of readers.get(one) ?? []) after.add(reader);
  const exact = [], any = [];
  for (const one of graph.nodes) {
    if (after.has(one.id)) continue;
    for (const [name, made] of Object.entries(one.outputs)) {
      if (made.kind !== about.kind) continue;
      if (made.semantic === about.semantic) exact.push(`${one.id}.${name}`);
      else if (made.semantic === "any" || about.semantic === "any") any.push(`${one.id}.${name}`);
    }
  }
  return [...exact, ...any];
}

function linkRow(graph, node, name, about, edits) {
  const path = `${node}.${name}`;
  const links = [since(edits, path, about.links)].flat().filter(Boolean);
  const words = [...new Set([...(about.optional || about.many ? [""] : []), ...links, ...fitting(graph, node, about)])];
  // An input that takes many has a list for each, and one more to add to them.
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

// The pipeline's own parameters, where no node is chosen; else everything that the node can be told.
export function showParameters(place, pipeline, node, edits) {
  // What somebody writes in is not taken from under the hand. What is dragged lets go, and a colour's window closes, where
  // elements around it come and go, so all of that waits.
  if (held !== null) return;
  const kept = writing && place.contains(writing) ? writing.closest(".parameter") : null;
  const made = [pipeline, node, JSON.stringify(edits)];
  if (made.every((part, i) => part === drawn.made[i]) && (drawn.kept === null || drawn.kept === kept)) return;
  drawn = { made, kept, fresh: null };
  const focused = document.activeElement?.id;
  const parts = [];
  const about = pipeline.nodes[node];
  if (!about) {
    const own = Object.entries(pipeline.parameters);
    parts.push(h("p", { class: "doc" }, own.length ? "Parameters of the pipeline." : "Choose a node, here or in the graph."));
    for (const [name, found] of own) parts.push(setting(name, name, found, edits));
  } else {
    const options = (words) => words.map((word) => h("option", { value: word }, word));
    const others = about.other_types.filter((word) => word !== about.type);
    const types = h("select", { id: `p-${node}.type`, onchange: () => set(`${node}.type`, types.value) },
      ...options([...new Set([about.type, ...about.types])]),
      others.length ? h("optgroup", { label: "with other links" }, ...options(others)) : null);
    types.value = since(edits, `${node}.type`, about.type);
    const enabled = h("input", { type: "checkbox", id: `p-${node}.enabled`, onchange: () => set(`${node}.enabled`, enabled.checked) });
    enabled.checked = since(edits, `${node}.enabled`, true);
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
  const at = kept ? parts.findIndex((part) => part.dataset.path === kept.dataset.path) : -1;
  if (at < 0) place.replaceChildren(...parts);
  else {  // a row that is moved loses the focus, so the others go around it
    drawn.fresh = parts[at];
    for (const other of [...place.children]) if (other !== kept) other.remove();
    kept.before(...parts.slice(0, at));
    kept.after(...parts.slice(at + 1));
    return;
  }
  if (!focused?.startsWith("p-")) return;
  const again = document.getElementById(focused);
  again?.focus();
  if (again?.matches("input[type=number], input[type=text]")) again.select();  // as a field is that Tab leads to
}

// A field is written in from the first letter until it is taken over or left.
export function startParameters(place) {
  place.addEventListener("input", ({ target }) => { if (target.matches("input[type=number], input[type=text]")) writing = target; });
  place.addEventListener("change", () => { writing = drawn.fresh = null; });  // what was written is newer
  place.addEventListener("focusout", ({ relatedTarget }) => {
    writing = null;
    const { kept, fresh } = drawn;
    if (!fresh || kept.contains(relatedTarget)) return;
    drawn.kept = drawn.fresh = null;
    kept.replaceWith(fresh);  // and no other row: the hand may be on its way to one
  });
}
