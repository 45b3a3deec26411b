// The graph: nodes as cards in SVG, laid out by ELK.
import { drop, fits, misfit, offer } from "./editor.js";
import { s, short } from "./dom.js";
import { send } from "./socket.js";

const WIDE = 190, HEAD = 40, ROW = 18, PICTURE = 88;
let elk = null;      // the worker, or ELK itself
let asked = 0;
const waiting = new Map();  // layouts that were asked for, by number
let cached = null;     // the last layout, and its graph
let latest = 0;
let drawn = null;    // what is drawn: its content, cards and lines
let scale = 0;       // until the graph is first drawn
let dragged = null;  // the end of a link that is being dragged: {output} or {input}

const previews = new Map();  // port to the address of its thumbnail

// Compute a layout: in a worker, or where the page has ELK in itself, as an exported one, with that.
function computeLayout(graph) {
  if (globalThis.ELK) {
    elk ??= new globalThis.ELK();
    return elk.layout(graph);
  }
  if (!elk) {
    elk = new Worker(new URL("layout-worker.js", document.baseURI));
    elk.onmessage = ({ data: { id, layout } }) => { waiting.get(id)(layout); waiting.delete(id); };
  }
  const id = ++asked;
  elk.postMessage({ id, graph });
  return new Promise((resolve) => { waiting.set(id, resolve); });
}

const endOf = (node, name) => node.ends?.[name] ?? `${node.id}.${name}`;
const mainPort = (node) => Object.keys(node.outputs).map((name) => endOf(node, name)).find((end) => previews.has(end));

function shapeOf(node) {
  const rows = Object.keys(node.inputs).length + Object.keys(node.outputs).length;
  return { width: WIDE, height: HEAD + rows * ROW + PICTURE + 8 };
}

// The graph as ELK takes it: ports keep their order, inputs in the west (from the bottom), outputs in the east.
function asElk(graph, disabled) {
  const children = graph.nodes.map((node) => {
    const inputs = Object.keys(node.inputs), outputs = Object.keys(node.outputs);
    const port = (side, name, index, y) => ({
      id: `${node.id}|${side}|${name}`, width: 1, height: 1, x: side === "in" ? 0 : WIDE, y,
      layoutOptions: { "elk.port.side": side === "in" ? "WEST" : "EAST", "elk.port.index": index },
    });
    const ports = [
      ...inputs.map((name, i) => port("in", name, inputs.length - i, HEAD + (i + 0.5) * ROW)),
      ...outputs.map((name, i) => port("out", name, i, HEAD + (inputs.length + i + 0.5) * ROW)),
    ];
    const before = cached?.layout.children.find((child) => child.id === node.id);
    const position = before && { "elk.position": `(${before.x},${before.y})` };  // nodes of a layer keep their order
    return { id: node.id, ...shapeOf(node), ports, layoutOptions: { "elk.portConstraints": "FIXED_POS", ...position } };
  });
  const edges = graph.links.map((link, i) => ({
    id: `e${i}`, sources: [`${link.source}|out|${link.source_port}`], targets: [`${link.target}|in|${link.target_port}`],
  }));
  return {
    id: "root", edges,
    children: [...children, ...disabled.map((name) => ({ id: `disabled ${name}`, width: WIDE, height: HEAD }))],
    layoutOptions: {
      "elk.algorithm": "layered", "elk.direction": "RIGHT", "elk.layered.spacing.nodeNodeBetweenLayers": "60",
      "elk.layered.crossingMinimization.semiInteractive": "true", "elk.spacing.nodeNode": "24", "elk.edgeRouting": "SPLINES", "elk.layered.feedbackEdges": "true",
    },
  };
}

function edgePath(section) {
  const points = [section.startPoint, ...(section.bendPoints ?? []), section.endPoint];
  let d = `M${points[0].x},${points[0].y}`;
  let i = 1;
  for (; i + 2 < points.length; i += 3) {
    d += `C${points[i].x},${points[i].y} ${points[i + 1].x},${points[i + 1].y} ${points[i + 2].x},${points[i + 2].y}`;
  }
  for (; i < points.length; i++) d += `L${points[i].x},${points[i].y}`;
  return d;
}

function describeOutput(output) {
  if (output.format) {
    const more = [output.layers > 1 && `${output.layers} layers`, output.mips > 1 && `${output.mips} mips`, output.samples > 1 && `${output.samples} samples`];
    return [`${output.format} ${output.size.join("×")}`, ...more.filter(Boolean)].join(", ");
  }
  return output.bytes ? `${output.bytes} B` : output.kind;
}

// The attributes of a button in a drawing.
const button = (label, press) => ({
  tabindex: 0, role: "button", "aria-label": label,
  onclick: (event) => { event.stopPropagation(); press(); },
  onkeydown: (event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    press();
  },
});

// A node that is disabled has no ports and no place in the order; its button brings it back.
function disabledCard(name, box, act) {
  return s("g", { class: "card idle", transform: `translate(${box.x},${box.y})`, ...button(`Enable ${name}`, () => act.enable(name)) },
    s("title", {}, `${name} is disabled; press to enable it`),
    s("rect", { class: "box", width: box.width, height: box.height, rx: 6 }),
    s("text", { x: 8, y: 16, "font-weight": 600 }, name), s("text", { x: 8, y: 31, class: "quiet" }, "disabled"));
}

const clip = (text, most) => (text.length > most ? `${text.slice(0, most - 1)}…` : text);

// The parts of a card that change with pictures are filled in by `refresh`.
function card(node, box, why, act) {
  const inputs = Object.keys(node.inputs), outputs = Object.entries(node.outputs);
  const choose = node.inner ? () => act.open(node.id) : () => act.node(node.id);
  const pinOf = (...words) => (node.inner ? "" : pin(...words));  // what is inside is connected in its own file
  const title = node.inner ? `${node.id}: ${node.type} in one card` : why === undefined ? `${node.id}: ${node.type}` : `${node.id} does not run: ${why}`;
  const bar = s("rect", { class: "time", x: 1, y: HEAD - 5, height: 3, width: 0 });
  const time = s("text", { x: box.width - 8, y: 16, "text-anchor": "end", class: "quiet" });
  const image = s("image", {
    x: 8, y: box.height - PICTURE - 4, width: box.width - 16, height: PICTURE, class: "port",
    onclick: (event) => { event.stopPropagation(); act.port(mainPort(node)); },
  });
  const group = s("g", {
    class: "card", transform: `translate(${box.x},${box.y})`, role: "group", "aria-label": title, "data-node": node.id,
    onclick: choose,
  }, s("title", {}, title), s("rect", { class: "box", width: box.width, height: box.height, rx: 6 }),
  s("rect", { x: 1, y: 8, width: 3, height: HEAD - 16, rx: 1, fill: familyColor(node.family) }),
  s("g", button(`${node.inner ? "Open" : "Choose"} ${node.id}`, choose), s("rect", { class: "head", width: box.width, height: HEAD - 5 }),
    s("text", { x: 8, y: 16, "font-weight": 600 }, clip(node.id, 18)), s("text", { x: 8, y: 31, class: "quiet" }, clip(node.type, 26))), bar, time);
  inputs.forEach((name, i) => {
    const y = HEAD + (i + 0.5) * ROW;
    group.append(s("text", { x: 8, y: y + 4, class: "quiet" }, clip(name, 26)), pinOf("input", node.id, name, 0, y));
  });
  outputs.forEach(([name, output], i) => {
    const y = HEAD + (inputs.length + i + 0.5) * ROW + 4;
    group.append(s("g", {
      class: "port", ...button(`Show ${endOf(node, name)}`, () => act.port(endOf(node, name))),
    }, s("title", {}, `${describeOutput(output)}${output.used ? "" : ", unused"}`),
    s("text", { x: box.width - 8, y, "text-anchor": "end", class: output.used ? "" : "quiet" }, clip(name, 26))), pinOf("output", node.id, name, box.width, y - 4));
  });
  group.append(image);
  return { node, group, bar, time, image, width: box.width };
}

// Put times, thumbnails and marks on the cards, where they have changed.
function refresh({ cards, lines }, { times, reused, culled, chosen, link, wrong }) {
  const all = Math.max(1e-9, Object.values(times).reduce((sum, one) => sum + one, 0));
  const put = (element, name, value) => { if (element.getAttribute(name) !== value) element.setAttribute(name, value); };
  for (const { node, group, bar, time, image, width } of cards) {
    const { id } = node;
    const inner = (node.inner ?? [node]).map((one) => one.id);
    put(group, "class", ["card", inner.every((one) => culled[one] !== undefined) && "idle", chosen === id && "chosen", inner.some((one) => wrong.has(one)) && "wrong"].filter(Boolean).join(" "));
    const measured = inner.filter((one) => times[one] !== undefined);
    const ms = measured.length ? measured.reduce((sum, one) => sum + times[one], 0) : undefined;
    put(bar, "width", String(ms === undefined ? 0 : Math.max(1, (ms / all) * (width - 2))));
    time.textContent = ms === undefined ? "" : measured.every((one) => reused.has(one)) ? "reused" : `${short(Number(ms.toFixed(2)))} ms`;
    const port = mainPort(node);
    if (port) put(image, "href", previews.get(port));
  }
  for (const { path, words } of lines) path.classList.toggle("chosen", link === words);
}

// The end of a link in a drawing, from which one can be dragged.
const pin = (side, node, port, x, y) => s("circle", { class: `pin ${side}`, "data-end": `${node}.${port}`, cx: x, cy: y, r: 5 },
  s("title", {}, `drag to connect ${node}.${port}`));

// Drag from a pin: a line follows, what fits stands out, and what is under the end is connected or offered.
function startDrag(container, event) {
  const from = event.target.closest?.(".pin");
  const svg = container.querySelector("svg");
  if (!from || event.button !== 0 || !svg) return;
  event.preventDefault();
  dragged = { [from.classList.contains("output") ? "output" : "input"]: from.dataset.end };
  const start = from.getBoundingClientRect();
  const frame = svg.getBoundingClientRect();
  const at = (x, y) => [(x - frame.left) / scale, (y - frame.top) / scale];
  const [x0, y0] = at(start.left + start.width / 2, start.top + start.height / 2);
  const line = s("path", { class: "edge dragged" });
  svg.append(line);
  for (const card of svg.querySelectorAll("[data-node]")) card.classList.toggle("apart", card !== from.closest("[data-node]") && !fits(card.dataset.node, dragged));
  const move = (now) => {
    const [x, y] = at(now.clientX, now.clientY);
    const bend = Math.max(30, Math.abs(x - x0) / 2) * (dragged.output ? 1 : -1);
    line.setAttribute("d", `M${x0},${y0}C${x0 + bend},${y0} ${x - bend},${y} ${x},${y}`);
  };
  const end = (now) => {
    container.removeEventListener("pointermove", move);
    const what = dragged;
    dragged = null;
    line.remove();
    for (const card of svg.querySelectorAll(".apart")) card.classList.remove("apart");
    if (now.type === "pointercancel") return;
    const under = document.elementFromPoint(now.clientX, now.clientY);
    const pinned = under?.closest(`.pin.${what.output ? "input" : "output"}`);
    const card = under?.closest("[data-node]");
    if (card && `${Object.values(what)[0]}`.split(".")[0] === card.dataset.node) return;  // back where it began
    if (card && fits(card.dataset.node, what)) drop(card.dataset.node, what, pinned?.dataset.end.split(".")[1]);
    else if (card) misfit(card.dataset.node, what);
    else if (!card && container.contains(under)) offer(what);
  };
  container.setPointerCapture(event.pointerId);
  container.addEventListener("pointermove", move);
  container.addEventListener("pointerup", end, { once: true });
  container.addEventListener("pointercancel", end, { once: true });
}

// The nodes whose cards are in sight.
function nodesInSight(container) {
  const inside = new Map((drawn?.cards ?? []).filter(({ node }) => node.inner).map(({ node }) => [node.id, node.inner.map(({ id }) => id)]));
  const [left, top] = [container.scrollLeft / scale, container.scrollTop / scale];
  const [right, bottom] = [left + container.clientWidth / scale, top + container.clientHeight / scale];
  return cached.layout.children.filter(({ x, y, width, height }) => x < right && x + width > left && y < bottom && y + height > top)
    .flatMap(({ id }) => inside.get(id) ?? [id]).filter((id) => !id.startsWith("disabled "));
}

// Ask for the thumbnails of what is in sight, once scrolling pauses.
let asking = null;
let inSight = "";
function askThumbnails(container) {
  clearTimeout(asking);
  asking = setTimeout(() => {
    const nodes = nodesInSight(container);
    if (inSight === (inSight = nodes.join())) return;
    send({ do: "visible", nodes });
  }, 100);
}

function zoom(container, factor, x = container.clientWidth / 2, y = container.clientHeight / 2) {
  const svg = container.querySelector("svg");
  if (!svg || !cached) return;
  const before = scale;
  scale = factor === 0 ? fitting(container) : Math.min(2, Math.max(0.15, scale * factor));
  resize(svg);
  container.scrollTo((container.scrollLeft + x) * scale / before - x, (container.scrollTop + y) * scale / before - y);
  container.onscroll?.();
}

// The scale at which all of the graph is seen.
function fitting(container) {
  const { width, height } = cached.layout;
  return Math.min(1, (container.clientWidth - 32) / (width + 4), (container.clientHeight - 44) / (height + 4));
}

// A colour for each family, far apart for neighbours in the alphabet.
const hue = (family) => ([...(family ?? "")].reduce((sum, letter) => sum * 31 + letter.charCodeAt(0), 7) * 137) % 360;
const familyColor = (family) => `hsl(${hue(family)} 55% 50%)`;

// A small picture of the whole, with a frame around what is seen.
function showMinimap(container, graph) {
  const map = document.getElementById("minimap");
  const { width, height, children } = cached.layout;
  const family = new Map(graph.nodes.map((node) => [node.id, node.family]));
  map.setAttribute("viewBox", `0 0 ${width + 4} ${height + 4}`);
  const seen = s("rect", { class: "seen" });
  map.replaceChildren(...children.map((box) => s("rect", { x: box.x, y: box.y, width: box.width, height: box.height, fill: familyColor(family.get(box.id)) })), seen);
  const follow = () => {
    const [x, y, wide, high] = [container.scrollLeft, container.scrollTop, container.clientWidth, container.clientHeight].map((v) => v / scale);
    map.toggleAttribute("hidden", wide >= width && high >= height);
    for (const [name, value] of Object.entries({ x, y, width: wide, height: high })) seen.setAttribute(name, value);
    askThumbnails(container);
  };
  container.onscroll = follow;
  map.onpointerdown = (event) => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(map.getScreenCTM().inverse());
    container.scrollTo(at.x * scale - container.clientWidth / 2, at.y * scale - container.clientHeight / 2);
  };
  follow();
}

function resize(svg) {
  const { width, height } = cached.layout;
  svg.setAttribute("width", (width + 4) * scale);
  svg.setAttribute("height", (height + 4) * scale);
  svg.setAttribute("viewBox", `0 0 ${width + 4} ${height + 4}`);
}

// Connect by dragging, move by dragging the ground, and zoom by Ctrl and the wheel or by buttons.
export function startGraph(container, buttons) {
  container.addEventListener("pointerdown", (event) => {
    startDrag(container, event);
    if (dragged || event.pointerType === "touch" || event.target.closest(".card, .hit")) return;
    const [x, y, left, top] = [event.clientX, event.clientY, container.scrollLeft, container.scrollTop];
    const move = (now) => container.scrollTo(left + x - now.clientX, top + y - now.clientY);
    addEventListener("pointermove", move);
    addEventListener("pointerup", () => removeEventListener("pointermove", move), { once: true });
  });
  container.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    const { left, top } = container.getBoundingClientRect();
    zoom(container, Math.exp(-event.deltaY * 0.002), event.clientX - left, event.clientY - top);
  }, { passive: false });
  buttons.forEach(([button, factor]) => { button.onclick = () => zoom(container, factor); });
}

export function reveal(container, node) {
  const card = container.querySelector(`[data-node="${CSS.escape(node)}"]`);
  card?.scrollIntoView({ block: "center", inline: "center" });
  card?.querySelector("[role=button]")?.focus({ preventScroll: true });
}

export const preview = (port) => previews.get(port);

export function showPreviews(files, address) {
  for (const [port, blob] of Object.entries(files)) previews.set(port, address(`thumbnail ${port}`, blob));
}

// Draw the graph; another graph alone gets a new layout and new elements.
export async function showGraph(container, pipeline, facts, act) {
  if (!pipeline || container.hidden || container.offsetParent === null) return;
  const call = ++latest;
  const graph = pipeline.graph;
  const key = JSON.stringify([pipeline.disabled, graph.links, graph.nodes.map((node) => [node.id, Object.keys(node.inputs), Object.keys(node.outputs)])]);
  if (cached?.key !== key) {
    const layout = await computeLayout(asElk(graph, pipeline.disabled));
    if (call !== latest) return;  // a newer call has begun
    cached = { key, layout };
  }
  if (dragged) return;  // a hand holds what is there
  const content = JSON.stringify([key, graph.nodes.map((node) => [node.type, node.outputs]), pipeline.plan.culled]);
  if (drawn?.content !== content) {
    drawn = { content, ...drawGraph(container, pipeline, facts, act) };
    showMinimap(container, graph);
  }
  refresh(drawn, facts);
}

function drawGraph(container, pipeline, facts, act) {
  const { layout } = cached;
  const { graph } = pipeline;
  const box = new Map(layout.children.map((child) => [child.id, child]));
  const svg = s("svg", { role: "group", "aria-label": "Nodes and links" },
    s("defs", {}, s("pattern", { id: "hatched", width: 8, height: 8, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" },
      s("rect", { width: 8, height: 8, fill: "#7d8590", opacity: 0.12 }), s("line", { x1: 0, y1: 0, x2: 0, y2: 8, stroke: "#7d8590", "stroke-width": 3, opacity: 0.5 }))));
  const lines = [];
  layout.edges.forEach((edge, i) => {
    const link = graph.links[i];
    const output = graph.nodes.find((node) => node.id === link.source)?.outputs[link.source_port];
    const kind = output?.kind ?? "";
    const words = `${link.source}.${link.source_port} → ${link.target}.${link.target_port}`;
    const classes = ["edge", (kind === "function" || kind === "buffer") && kind, link.previous && "previous"];
    for (const section of edge.sections ?? []) {
      const d = edgePath(section);
      const path = s("path", { class: classes.filter(Boolean).join(" "), d });
      lines.push({ path, words });
      svg.append(path, s("path", { class: "hit", d, "data-link": words, onclick: () => act.link(link.own ?? link, words) },
        s("title", {}, `${words}${output ? `: ${output.semantic}` : ""}`)));
    }
  });
  const cards = graph.nodes.map((node) => card(node, box.get(node.id), facts.culled[node.id], act));
  svg.append(...cards.map(({ group }) => group), ...pipeline.disabled.map((name) => disabledCard(name, box.get(`disabled ${name}`), act)));
  const focused = document.activeElement?.getAttribute?.("aria-label");
  const { scrollLeft, scrollTop } = container;
  scale ||= Math.max(0.75, fitting(container));  // smaller text cannot be read
  resize(svg);
  container.replaceChildren(svg);
  container.scrollTo(scrollLeft, scrollTop);
  if (focused) container.querySelector(`[aria-label="${CSS.escape(focused)}"]`)?.focus({ preventScroll: true });
  return { cards, lines };
}
