// The graph: nodes as cards in SVG, cached out by ELK, which is loaded at first use.
import { drop, fits, offer } from "./editor.js";
import { h, s, short } from "./dom.js";

const WIDE = 190, HEAD = 40, ROW = 18, PICTURE = 88;
let elk = null;
let cached = null;     // the last layout, and its graph
let latest = 0;
let shown = null;    // what is shown
let updates = 0;    // counts updates of the thumbnails
let scale = 0;       // until the graph is first drawn
let dragged = null;  // the end of a link that is being dragged: {output} or {input}

const previews = new Map();  // port to the address of its thumbnail

function loadElk() {
  elk ??= new Promise((resolve, reject) => {
    if (globalThis.ELK) return resolve(new globalThis.ELK());
    const script = h("script", { src: new URL("vendor/elk.bundled.js", document.baseURI) });
    script.onload = () => resolve(new globalThis.ELK());
    script.onerror = () => reject(new Error("the layout cannot be loaded"));
    document.head.append(script);
  });
  return elk;
}

const mainPort = (node) => Object.keys(node.outputs).find((name) => previews.has(`${node.id}.${name}`));

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
    return { id: node.id, ...shapeOf(node), ports, layoutOptions: { "elk.portConstraints": "FIXED_POS" } };
  });
  const edges = graph.links.map((link, i) => ({
    id: `e${i}`, sources: [`${link.source}|out|${link.source_port}`], targets: [`${link.target}|in|${link.target_port}`],
  }));
  return {
    id: "root", edges,
    children: [...children, ...disabled.map((name) => ({ id: `disabled ${name}`, width: WIDE, height: HEAD }))],
    layoutOptions: {
      "elk.algorithm": "layered", "elk.direction": "RIGHT", "elk.layered.spacing.nodeNodeBetweenLayers": "60",
      "elk.spacing.nodeNode": "24", "elk.edgeRouting": "SPLINES", "elk.layered.feedbackEdges": "true",
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

function card(node, box, facts, act) {
  const { times, culled, chosen, wrong } = facts;
  const inputs = Object.keys(node.inputs), outputs = Object.entries(node.outputs);
  const ms = times[node.id];
  const idle = culled[node.id] !== undefined;
  const all = Math.max(1e-9, Object.values(times).reduce((sum, one) => sum + one, 0));
  const title = idle ? `${node.id} does not run: ${culled[node.id]}` : `${node.id}: ${node.type}`;
  const clip = (text, most) => (text.length > most ? `${text.slice(0, most - 1)}…` : text);
  const group = s("g", {
    class: ["card", idle && "idle", chosen === node.id && "chosen", wrong.has(node.id) && "wrong"].filter(Boolean).join(" "),
    transform: `translate(${box.x},${box.y})`, role: "group", "aria-label": title, "data-node": node.id,
    onclick: () => act.node(node.id),
  }, s("title", {}, title), s("rect", { class: "box", width: box.width, height: box.height, rx: 6 }),
  s("g", button(`Choose ${node.id}`, () => act.node(node.id)), s("rect", { class: "head", width: box.width, height: HEAD - 5 }),
    s("text", { x: 8, y: 16, "font-weight": 600 }, clip(node.id, 18)), s("text", { x: 8, y: 31, class: "quiet" }, clip(node.type, 26))));
  if (ms !== undefined) {
    group.append(s("rect", { class: "time", x: 1, y: HEAD - 5, height: 3, width: Math.max(1, (ms / all) * (box.width - 2)) }));
    group.append(s("text", { x: box.width - 8, y: 16, "text-anchor": "end", class: "quiet" }, `${short(Number(ms.toFixed(2)))} ms`));
  }
  inputs.forEach((name, i) => {
    const y = HEAD + (i + 0.5) * ROW;
    group.append(s("text", { x: 8, y: y + 4, class: "quiet" }, clip(name, 26)), pin("input", node.id, name, 0, y));
  });
  outputs.forEach(([name, output], i) => {
    const y = HEAD + (inputs.length + i + 0.5) * ROW + 4;
    group.append(s("g", {
      class: "port", ...button(`Show ${node.id}.${name}`, () => act.port(`${node.id}.${name}`)),
    }, s("title", {}, `${describeOutput(output)}${output.used ? "" : ", unused"}`),
    s("text", { x: box.width - 8, y, "text-anchor": "end", class: output.used ? "" : "quiet" }, clip(name, 26))), pin("output", node.id, name, box.width, y - 4));
  });
  const port = mainPort(node);
  if (port) {
    group.append(s("image", {
      href: previews.get(`${node.id}.${port}`), x: 8, y: box.height - PICTURE - 4, width: box.width - 16, height: PICTURE,
      class: "port", onclick: (event) => { event.stopPropagation(); act.port(`${node.id}.${port}`); },
    }, s("title", {}, `${node.id}.${port}`)));
  }
  return group;
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
  for (const card of svg.querySelectorAll("[data-node]")) card.classList.toggle("apart", !fits(card.dataset.node, dragged));
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
    else if (!card && container.contains(under)) offer(what);
  };
  container.setPointerCapture(event.pointerId);
  container.addEventListener("pointermove", move);
  container.addEventListener("pointerup", end, { once: true });
  container.addEventListener("pointercancel", end, { once: true });
}

function zoom(container, factor, x = container.clientWidth / 2, y = container.clientHeight / 2) {
  const svg = container.querySelector("svg");
  if (!svg || !cached) return;
  const before = scale;
  scale = factor === 0 ? fitting(container) : Math.min(2, Math.max(0.15, scale * factor));
  resize(svg);
  container.scrollTo((container.scrollLeft + x) * scale / before - x, (container.scrollTop + y) * scale / before - y);
}

// The scale at which all of the graph is seen.
function fitting(container) {
  const { width, height } = cached.layout;
  return Math.min(1, (container.clientWidth - 32) / (width + 4), (container.clientHeight - 44) / (height + 4));
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
  updates += 1;
  for (const [port, blob] of Object.entries(files)) previews.set(port, address(`thumbnail ${port}`, blob));
}

// Draw the graph; compute a new layout only for another graph.
export async function showGraph(container, pipeline, facts, act) {
  if (!pipeline || container.hidden) return;
  const next = JSON.stringify([pipeline.revision, updates, facts.times, facts.chosen, facts.link, [...facts.wrong]]);
  if (next === shown) return;
  shown = next;
  const call = ++latest;
  const graph = pipeline.graph;
  const key = JSON.stringify([pipeline.disabled, graph.links, graph.nodes.map((node) => [node.id, Object.keys(node.inputs), Object.keys(node.outputs)])]);
  if (cached?.key !== key) {
    const layout = await (await loadElk()).layout(asElk(graph, pipeline.disabled));
    cached = { key, layout };
  }
  if (call !== latest || dragged) { shown = null; return; }  // a newer call has begun, or a hand holds what is there
  const { layout } = cached;
  const box = new Map(layout.children.map((child) => [child.id, child]));
  const svg = s("svg", { role: "group", "aria-label": "Nodes and links" },
    s("defs", {}, s("pattern", { id: "hatched", width: 8, height: 8, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" },
      s("rect", { width: 8, height: 8, fill: "#7d8590", opacity: 0.12 }), s("line", { x1: 0, y1: 0, x2: 0, y2: 8, stroke: "#7d8590", "stroke-width": 3, opacity: 0.5 }))));
  layout.edges.forEach((edge, i) => {
    const link = graph.links[i];
    const output = graph.nodes.find((node) => node.id === link.source)?.outputs[link.source_port];
    const kind = output?.kind ?? "";
    const words = `${link.source}.${link.source_port} → ${link.target}.${link.target_port}`;
    const classes = ["edge", (kind === "function" || kind === "buffer") && kind, link.previous && "previous", facts.link === words && "chosen"];
    for (const section of edge.sections ?? []) {
      const d = edgePath(section);
      svg.append(s("path", { class: classes.filter(Boolean).join(" "), d }),
        s("path", { class: "hit", d, "data-link": words, onclick: () => act.link(link, words) }, s("title", {}, `${words}${output ? `: ${output.semantic}` : ""}`)));
    }
  });
  for (const node of graph.nodes) svg.append(card(node, box.get(node.id), facts, act));
  for (const name of pipeline.disabled) svg.append(disabledCard(name, box.get(`disabled ${name}`), act));
  const focused = document.activeElement?.getAttribute?.("aria-label");
  const { scrollLeft, scrollTop } = container;
  scale ||= Math.max(0.75, fitting(container));  // smaller text cannot be read
  resize(svg);
  container.replaceChildren(svg);
  container.scrollTo(scrollLeft, scrollTop);
  if (focused) container.querySelector(`[aria-label="${CSS.escape(focused)}"]`)?.focus({ preventScroll: true });
}
