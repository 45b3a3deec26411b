// Changes of the graph: every one is a list of operations on the pipeline's text, which the server does and undoes.
import { $, h } from "./dom.js";
import { send } from "./socket.js";

let pipeline = null;
let types = null;      // that can be added, once they are asked for
let chosen = { node: "", link: null };
let offered = null;    // where the types that were asked for are to be offered
let added = "";        // the node to choose once it is there

function edit(...operations) {
  const [name, ...words] = operations[0];
  added = { add: words[0], duplicate: words[1], rename: words[1] }[name] ?? "";
  send({ do: "edit", operations });
}
const inputOf = (node, name) => pipeline.nodes[node]?.inputs[name];
const outputOf = (end) => {
  const [node, port] = end.split(".");
  return pipeline.graph.nodes.find((one) => one.id === node)?.outputs[port];
};

// Whether an output may be read by an input: 2 for the same meaning, 1 where one of them takes or makes any.
function fit(output, input) {
  if (!output || !input || output.kind !== input.kind) return 0;
  if (output.semantic === input.semantic) return 2;
  return Number(output.semantic === "any" || input.semantic === "any");
}

// The nodes that depend on a node, itself included.
export function readersOf(node, graph = pipeline.graph) {
  const found = new Set([node]);
  const links = graph.links.filter((link) => !link.previous);
  for (const one of found) for (const link of links) if (link.source === one) found.add(link.target);
  return found;
}

// The outputs that an input may read, the best first: of the same meaning and name, and late in the graph.
export function outputsFor(graph, input, without, called = "") {
  const found = graph.nodes.filter((node) => !without.has(node.id)).flatMap((node) => Object.entries(node.outputs)
    .map(([name, output]) => ({ end: `${node.id}.${name}`, rank: fit(output, input) && 2 * fit(output, input) + Number(name === called) })));
  return found.filter(({ rank }) => rank).reverse().sort((a, b) => b.rank - a.rank).map(({ end }) => end);
}

// The inputs of a node that may read an output, and the outputs that an input of another may read.
const inputsFor = (node, end) => (readersOf(node).has(end.split(".")[0]) ? [] : Object.keys(pipeline.nodes[node].inputs)
  .filter((name) => fit(outputOf(end), inputOf(node, name))));

// Whether the end of a dragged link may be dropped on a node.
export function fits(node, { output, input }) {
  if (output) return inputsFor(node, output).length > 0;
  const [target, port] = input.split(".");
  return outputsFor(pipeline.graph, inputOf(target, port), readersOf(target)).some((end) => end.split(".")[0] === node);
}

function freshId(base) {
  const taken = new Set([...Object.keys(pipeline.nodes), ...pipeline.disabled]);
  for (let number = 1; ; number++) {
    const id = number === 1 ? base : `${base}_${number}`;
    if (!taken.has(id)) return id;
  }
}

function connect(output, input) {
  const [node, name] = input.split(".");
  const about = inputOf(node, name);
  edit(["connect", input, about?.many ? [...new Set([...about.links, output])] : [output]]);
}

// Join the dragged end with a node: at the one port that fits, or at one that is chosen from a list.
export function drop(node, { output, input }, port) {
  if (output) {
    const names = port ? [port] : inputsFor(node, output);
    if (names.length === 1) return connect(output, `${node}.${names[0]}`);
    return openPalette(`Connect ${output} with an input of ${node}`, names.map((name) => ({
      name, doc: inputOf(node, name).doc, press: () => connect(output, `${node}.${name}`),
    })));
  }
  const [target, name] = input.split(".");
  const ends = port ? [`${node}.${port}`]
    : outputsFor(pipeline.graph, inputOf(target, name), readersOf(target)).filter((end) => end.split(".")[0] === node);
  if (ends.length === 1) return connect(ends[0], input);
  return openPalette(`Connect an output of ${node} with ${input}`, ends.map((end) => ({ name: end, doc: "", press: () => connect(end, input) })));
}

// Outputs that a node continues, as `bloom` does the radiance that it adds to: no other may continue the same.
const continued = () => new Set(pipeline.graph.links.filter((link) => link.target_port
  in (pipeline.graph.nodes.find((node) => node.id === link.target)?.outputs ?? {})).map((link) => `${link.source}.${link.source_port}`));

// Links for the required inputs of a new node, or null where the graph has nothing for one of them.
function linksFor(type, given, without) {
  const links = { ...given };
  for (const [name, input] of Object.entries(type.inputs)) {
    if (input.optional || links[name]) continue;
    const taken = name in type.outputs ? continued() : new Set();
    const best = outputsFor(pipeline.graph, input, without, name).find((end) => !taken.has(end));
    if (!best) return null;
    links[name] = best;
  }
  return links;
}

const bestPort = (ports, rank) => Object.entries(ports).map(([name, port]) => [name, rank(port)])
  .filter(([, value]) => value).sort((a, b) => b[1] - a[1])[0]?.[0];

// The operations that add a node of a type where a link was dropped or chosen; null where it does not fit.
function additions(type, { output, input, link }) {
  const id = freshId(type.name);
  if (link) {
    const end = `${link.target}.${link.target_port}`;
    const made = outputOf(`${link.source}.${link.source_port}`);
    const port = bestPort(type.inputs, (one) => fit(made, one));
    const out = bestPort(type.outputs, (one) => fit(one, made));
    const links = port && out && linksFor(type, { [port]: `${link.source}.${link.source_port}` }, readersOf(link.target));
    if (!links) return null;
    const about = inputOf(link.target, link.target_port);
    const others = about?.many ? about.links.map((one) => (one === `${link.source}.${link.source_port}` ? `${id}.${out}` : one)) : [`${id}.${out}`];
    return [["add", id, type.name, links], ["connect", end, others]];
  }
  if (output) {
    const port = bestPort(type.inputs, (one) => fit(outputOf(output), one));
    const links = port && linksFor(type, { [port]: output }, new Set());
    return links ? [["add", id, type.name, links]] : null;
  }
  if (input) {
    const [target, name] = input.split(".");
    const about = inputOf(target, name);
    const out = bestPort(type.outputs, (one) => fit(one, about));
    const before = about?.links[0];  // what the input has read goes through the new node, if that takes it
    const port = before && bestPort(type.inputs, (one) => fit(outputOf(before), one));
    const links = out && linksFor(type, port ? { [port]: before } : {}, readersOf(target));
    if (!links) return null;
    return [["add", id, type.name, links], ["connect", input, about.many && !port ? [...about.links, `${id}.${out}`] : [`${id}.${out}`]]];
  }
  const links = linksFor(type, {}, new Set());
  return links && [["add", id, type.name, links]];
}

// Open a list of the node types that fit where a link was dropped or chosen, or of all.
export function offer(place = {}) {
  if (!types) {
    offered = place;
    return send({ do: "types" });
  }
  const end = place.output ?? place.input;
  const title = place.link ? "Insert a node" : end ? `Add a node at ${end}` : "Add a node";
  const choices = types.map((type) => ({ type, operations: additions(type, place) })).filter(({ operations }) => operations);
  const linked = place.input && inputOf(...place.input.split("."))?.links.length;
  const disconnect = { name: "Disconnect", doc: `Remove the link of ${place.input}.`, press: () => edit(["disconnect", place.input]) };
  openPalette(title, [...(linked ? [disconnect] : []), ...choices.map(({ type, operations }) => ({
    name: type.name, family: type.family, doc: type.doc, press: () => edit(...operations),
  }))]);
}

export function showTypes(facts) {
  ({ types } = facts);
  if (offered) offer(offered);
}

function openPalette(title, choices) {
  offered = null;
  const search = $("palette-search"), list = $("palette-list");
  $("palette-title").textContent = title;
  const show = () => {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const rank = ({ name }) => Number(!name.startsWith(words[0] ?? ""));
    const found = choices.filter(({ name, family, doc }) => words.every((word) => `${name} ${family ?? ""} ${doc}`.toLowerCase().includes(word)));
    const parts = [];
    let family = null;
    for (const choice of words.length ? found.sort((a, b) => rank(a) - rank(b)) : found) {
      if (!words.length && choice.family && choice.family !== family) parts.push(h("h3", {}, family = choice.family));
      parts.push(h("button", { class: "choice", onclick: () => { $("palette").close(); choice.press(); } },
        h("strong", {}, choice.name), h("span", { class: "quiet" }, choice.doc)));
    }
    list.replaceChildren(...(parts.length ? parts : [h("p", { class: "quiet" }, "Nothing fits.")]));
  };
  search.value = "";
  search.oninput = show;
  show();
  $("palette").showModal();
  search.focus();
}

// What a node's output comes from, if one of its inputs means the same.
function sourceOf(end) {
  const { inputs } = pipeline.nodes[end.split(".")[0]];
  return Object.values(inputs).find((input) => fit(outputOf(end), input) === 2 && input.links.length)?.links[0];
}

// What needs an output of a deleted node reads what that comes from instead.
function deleteNode(node) {
  const links = pipeline.graph.links.filter((link) => link.source === node && !link.previous)
    .filter((link) => inputOf(link.target, link.target_port)?.optional === false)
    .map((link) => [`${link.target}.${link.target_port}`, `${node}.${link.source_port}`]);
  const outputs = Object.entries(pipeline.graph.outputs).filter(([, end]) => end.split(".")[0] === node).map(([name, end]) => [`outputs.${name}`, end]);
  const bypass = [...links, ...outputs].filter(([, end]) => sourceOf(end)).map(([reader, end]) => ["connect", reader, [sourceOf(end)]]);
  edit(...bypass, ["delete", node]);
}

// What the copy continues is the original's, as no two may continue the same.
function duplicate(node) {
  const copy = freshId(node);
  const found = pipeline.graph.nodes.find((one) => one.id === node);
  const ports = Object.keys(found.outputs).filter((name) => found.inputs[name]?.length);
  edit(["duplicate", node, copy], ...ports.map((name) => ["connect", `${copy}.${name}`, [`${node}.${name}`]]));
}

function deleteLink({ source, source_port, target, target_port }) {
  const left = (inputOf(target, target_port)?.links ?? []).filter((one) => one !== `${source}.${source_port}`);
  const end = `${target}.${target_port}`;
  edit(left.length ? ["connect", end, left] : ["disconnect", end]);
}

function deleteChosen() {
  if (chosen.link) deleteLink(chosen.link);
  else if (chosen.node) deleteNode(chosen.node);
}

function insertHere() {
  if (chosen.link) return offer({ link: chosen.link });
  const link = pipeline.graph.links.find((one) => one.target === chosen.node && !one.previous);
  if (link) offer({ link });
}

// Show what can be done with the chosen node or link.
export function showEditor(now, node, link) {
  pipeline = now;
  chosen = { node, link };
  const own = node && !node.includes("/");  // what is inside a sub-pipeline is changed in its file
  $("insert").disabled = !link && !(own && now.graph.links.some((one) => one.target === node));
  $("delete").disabled = !link && !own;
  for (const id of ["duplicate", "rename", "disable"]) $(id).disabled = !own || Boolean(link);
  const names = Object.keys(now.nodes);
  if ($("find-list").childElementCount !== names.length || names.some((name, i) => $("find-list").children[i].value !== name)) {
    $("find-list").replaceChildren(...names.map((name) => h("option", { value: name })));
  }
}

// Return the node that was added, once the graph has it.
export function takeAdded(nodes) {
  const id = added in nodes ? added : "";
  if (id) added = "";
  return id;
}

// Say why a dragged link cannot be dropped on a node.
export function misfit(node, { output, input }) {
  const end = output ?? input;
  const about = output ? outputOf(output) : inputOf(...input.split("."));
  const loops = readersOf(output ? node : end.split(".")[0]).has(output ? end.split(".")[0] : node);
  say(loops ? `${node} and ${end} would form a cycle` : `${node} has no ${output ? "input" : "output"} for ${end} (${about?.semantic ?? "any"})`);
}

let say = () => {};

export function startEditor(find, tell) {
  say = tell;
  $("add").onclick = () => offer();
  $("insert").onclick = insertHere;
  $("delete").onclick = deleteChosen;
  $("duplicate").onclick = () => duplicate(chosen.node);
  $("disable").onclick = () => send({ do: "set", path: `${chosen.node}.enabled`, value: false });
  $("rename").onclick = () => { $("new-name").value = chosen.node; $("renaming").returnValue = ""; $("renaming").showModal(); $("new-name").select(); };
  $("renaming").onclose = () => { if ($("renaming").returnValue === "rename" && $("new-name").value !== chosen.node) edit(["rename", chosen.node, $("new-name").value]); };
  $("find").onchange = () => {
    const words = $("find").value.trim().toLowerCase(), names = Object.keys(pipeline?.nodes ?? {});
    const found = names.find((name) => name === $("find").value) ?? names.find((name) => name.toLowerCase().startsWith(words))
      ?? names.find((name) => `${name} ${pipeline.nodes[name].type}`.toLowerCase().includes(words));
    if (words && found) find(found);
    else if (words) say(`there is no node “${words}”`);
  };
  $("palette").addEventListener("keydown", (event) => {
    const buttons = [...$("palette-list").querySelectorAll("button")];
    const at = buttons.indexOf(document.activeElement);
    if (event.key === "ArrowDown") (buttons[at + 1] ?? buttons[at])?.focus();
    else if (event.key === "ArrowUp") (buttons[at - 1] ?? $("palette-search")).focus();
    else if (event.key === "Enter" && at < 0) buttons[0]?.click();
    else return;
    event.preventDefault();
  });
  $("graph").addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.target.matches("input")) return;
    const press = { Delete: deleteChosen, Backspace: deleteChosen, a: () => offer(), "/": () => $("find").focus() }[event.key];
    if (!press) return;
    event.preventDefault();
    press();
  });
}
