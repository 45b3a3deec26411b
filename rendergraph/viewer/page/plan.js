// The plan as a matrix of steps and resources, and the times of each pass.
import { h, s, short } from "./dom.js";

const MOST_STEPS = 200;
const mebibytes = (bytes) => `${(bytes / 1048576).toFixed(2)} MiB`;

function useOf(step, id) {
  const wrote = step.writes.some((write) => write.resource === id);
  const reads = step.reads.filter((read) => read.resource === id);
  if (wrote && reads.length) return "B";
  if (wrote) return "W";
  return reads.length ? (reads.every((read) => read.previous) ? "P" : "R") : "";
}

const MEANS = { R: "reads", W: "writes", B: "reads and writes", P: "reads the last frame's value" };

export function showMemory(container, pipeline) {
  if (!pipeline || container.hidden) return;
  const { plan } = pipeline;
  const { memory } = plan;
  const summary = h("p", {}, `Allocated ${mebibytes(memory.allocated_bytes)} of ${mebibytes(memory.no_reuse_bytes)} without reuse; `
    + `no order needs less than ${mebibytes(memory.lower_bound_bytes)}${memory.proven ? "" : " (not reached)"}; shared by ${memory.tier}`
    + `${memory.peak_node ? `; the peak is at ${memory.peak_node}` : ""}.`);
  const steps = plan.order.slice(0, MOST_STEPS);
  const head = h("tr", {}, h("th", {}, "texture"), ...steps.map((step) => h("th", { class: "step", title: step.reason }, step.name)),
    h("th", {}, "in"), h("th", {}, "size"), h("th", {}, "why there"));
  const rows = plan.resources.map((resource) => h("tr", {}, h("th", { scope: "row" }, resource.id), ...steps.map((step, i) => {
    const use = useOf(step, resource.id);
    const alive = i >= resource.first && i <= resource.last;
    return h("td", { class: use || (alive ? "alive" : ""), title: use ? `${step.name} ${MEANS[use]} ${resource.id}` : null }, use);
  }), h("td", { class: "mono" }, resource.physical.join("+")), h("td", { class: "num" }, mebibytes(resource.bytes)), h("td", {}, resource.reason)));
  const culled = Object.entries(plan.culled).map(([node, why]) => h("li", {}, `${node}: ${why}`));
  const legend = h("p", { class: "quiet" }, "W writes, R reads, B both, P reads the last frame's; grey: in use. Rows with the same number share memory.");
  container.replaceChildren(summary, legend, h("table", { class: "matrix" }, head, ...rows),
    culled.length ? h("h2", {}, "Does not run") : "", culled.length ? h("ul", {}, ...culled) : "");
}

const time = (pass) => pass.gpu_ms ?? pass.cpu_ms;
const HIGH = 90, WIDE = 6;  // of the frame graph and of a picture in it

// The last pictures, each a column of the passes that ran for it.
function frameGraph(history) {
  const nodes = [...new Set(history.flatMap((one) => one.passes.map((pass) => pass.node)))];
  const color = (node) => `hsl(${(nodes.indexOf(node) * 137) % 360} 55% 50%)`;
  const sums = history.map((one) => one.passes.reduce((sum, pass) => sum + time(pass), 0));
  const most = Math.max(1e-9, ...sums);
  const columns = history.flatMap((one, at) => {
    let below = HIGH;
    return one.passes.map((pass) => {
      const height = (time(pass) / most) * HIGH;
      below -= height;
      return s("rect", { x: at * WIDE, y: below, width: WIDE - 1, height, fill: color(pass.node) },
        s("title", {}, `${pass.node}: ${short(Number(time(pass).toFixed(3)))} ms`));
    });
  });
  const names = nodes.map((node) => s("tspan", { fill: color(node) }, `■ ${node}  `));
  const caption = `Passes of the last ${history.length} pictures; the tallest is ${short(Number(most.toFixed(2)))} ms`;
  return h("figure", { class: "frames" }, h("figcaption", { class: "quiet" }, `${caption}.`),
    s("svg", { width: Math.max(600, history.length * WIDE), height: HIGH + 22, role: "img", "aria-label": caption },
      ...columns, s("text", { x: 0, y: HIGH + 16 }, ...names)));
}

export function showTimes(container, picture, history) {
  if (!picture || container.hidden) return;
  const most = Math.max(1e-9, ...picture.passes.map(time));
  const rows = picture.passes.map((pass) => {
    const bar = h("div", { class: "meter" });
    bar.style.width = `${(time(pass) / most) * 100}%`;
    const quiet = pass.ran ? {} : { class: "quiet", title: "Not run for this picture: its result was still valid." };
    const first = pass.first ? h("span", { class: "quiet", title: "The first run of these programs, which takes longer." }, " first run") : null;
    return h("tr", quiet, h("th", { scope: "row" }, pass.node), h("td", {}, pass.type),
      h("td", { class: "num" }, pass.gpu_ms === null ? "–" : short(Number(pass.gpu_ms.toFixed(3)))),
      h("td", { class: "num" }, short(Number(pass.cpu_ms.toFixed(3)))), h("td", { width: "300" }, bar, first));
  });
  const sorted = history.map((one) => one.ms).sort((a, b) => a - b);
  const middle = sorted[Math.floor(sorted.length / 2)];
  const software = picture.device.software ? ", a software rasteriser, not a GPU measurement" : "";
  container.replaceChildren(
    h("p", {}, `${short(picture.frame_ms)} ms for this picture, ${short(middle)} ms in the median of the last ${history.length}, on ${picture.device.renderer}${software}.`),
    frameGraph(history),
    h("table", { class: "times" }, h("tr", {}, h("th", {}, "node"), h("th", {}, "type"), h("th", {}, "GPU ms"), h("th", {}, "CPU ms"), h("th", {}, "share")), ...rows));
}
