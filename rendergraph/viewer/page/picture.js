// The picture, and moving the camera with mouse, wheel and keys.
import { $, choices, h, short } from "./dom.js";
import { send } from "./socket.js";

const urls = new Map();
let size = [1, 1];
let comparison = null;
let position = null;  // the position whose values are shown

// Return the address of a file; the earlier one of that name is revoked.
export function address(name, blob) {
  const before = urls.get(name);
  const url = typeof blob === "string" ? blob : URL.createObjectURL(blob);
  urls.set(name, url);
  if (before?.startsWith("blob:")) setTimeout(() => URL.revokeObjectURL(before), 1000);
  return url;
}

export function showPicture(facts, files) {
  const picture = $("picture");
  picture.src = address("picture", files.picture);
  picture.dataset.number = facts.frame;
  picture.dataset.count = Number(picture.dataset.count ?? 0) + 1;
  picture.dataset.still = facts.still;
  if (facts.still) size = facts.size;
  if (facts.still && position) send({ do: "pixel", ...position });  // the values have changed
  if (comparison) showComparison({}, {});  // that with this picture follows
  fit();
}

// Fit the picture into the room; large texels keep sharp edges.
function fit() {
  const [width, height] = size;
  const wide = matchMedia("(min-width: 1100px)").matches;
  const alone = document.body.classList.contains("picture-alone");
  const share = alone ? 0.8 : wide ? Number(document.body.style.getPropertyValue("--picture") || 0.36) : 0.68;
  const room = Math.min($("stage").clientWidth, (share * innerHeight * width) / height);
  const slider = $("slider");
  for (const image of [$("picture"), slider.under, slider.over]) {
    image.style.width = `${room}px`;
    image.style.height = `${(room * height) / width}px`;
    image.classList.toggle("pixels", room > 3 * width);
  }
}

export function showComparison(facts, files) {
  const slider = $("slider");
  const on = Boolean(files.other);
  slider.hidden = !on;
  $("picture").hidden = on;
  $("map-label").hidden = !on;
  comparison = on ? { facts, files } : null;
  if (!on) return;
  const map = $("map").value in files ? $("map").value : "other";
  slider.show(urls.get("picture"), address("other", files[map]), ["this", map === "other" ? facts.name : $("map").selectedOptions[0].text]);
}

export function showPixel({ pixel }) {
  if (!pixel?.at) return;
  const layer = pixel.layer === null ? "" : `, layer ${pixel.layer}`;
  $("pixel").textContent = `(${pixel.at.join(", ")}${layer})  ${pixel.values.map(short).join("  ")}`;
}

const FACES = ["+x", "-x", "+y", "-y", "+z", "-z"];

// What can be chosen of the shown texture, and how it is shown.
export function showLooking(pipeline, state) {
  const [base, part] = (state.port || "").split(/\[|\]/);
  const [node, port] = (base || pipeline.graph.outputs[pipeline.outputs[0]] || "").split(".");
  const output = pipeline.graph.nodes.find((one) => one.id === node)?.outputs[port];
  const layers = base ? (output?.kind === "texture_cube" ? 6 : output?.layers ?? 1) : 1;
  const mips = base ? output?.mips ?? 1 : 1;
  const layer = /^\d+/.exec(part ?? "")?.[0] ?? "", mip = /mip=(\d+)/.exec(part ?? "")?.[1] ?? "0";
  $("layer").parentElement.hidden = !(layers > 1);
  $("mip").parentElement.hidden = !(mips > 1);
  choices($("layer"), ["", ...Array(layers).keys()].map(String), layer, (name) => (name === "" ? "all" : output?.kind === "texture_cube" ? FACES[name] : name));
  choices($("mip"), [...Array(mips).keys()].map(String), mip);
  const look = () => {
    const words = [$("layer").value, $("mip").value !== "0" && `mip=${$("mip").value}`].filter(Boolean).join(",");
    send({ do: "look", port: words ? `${base}[${words}]` : base });
  };
  $("layer").onchange = $("mip").onchange = look;
  const { channel = "", scale = "", low = null, high = null } = state.look ?? {};
  $("channel").value = channel;
  $("scale").value = scale;
  for (const [id, value] of [["low", low], ["high", high]]) if (document.activeElement !== $(id)) $(id).value = value ?? "";
}

function startLooking() {
  for (const name of ["channel", "scale"]) $(name).onchange = () => send({ do: "look", [name]: $(name).value });
  for (const name of ["low", "high"]) {
    $(name).onchange = () => send({ do: "look", [name]: $(name).value === "" ? null : Number($(name).value), ...($("scale").value ? {} : { scale: "linear" }) });
  }
}

export function startPicture() {
  startLooking();
  const stage = $("stage");
  const picture = $("picture");
  let last = null;
  let lastRequest = 0;
  let pause = null;

  // Many small moves, as from the wheel or a key, count as one drag until they pause.
  const moveCamera = (move) => {
    if (pause === null) send({ do: "hold", on: true });
    clearTimeout(pause);
    pause = setTimeout(() => { pause = null; send({ do: "hold", on: false }); }, 250);
    send({ do: "camera", ...move });
  };

  // Two fingers zoom by their distance and pan by their middle.
  const fingers = new Map();
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return [Math.hypot(a[0] - b[0], a[1] - b[1]), (a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  };
  const pinch = (event, height) => {
    if (!fingers.has(event.pointerId)) return;
    const [wide, x, y] = spread();
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const [wider, nextX, nextY] = spread();
    if (wide > 0 && wider > 0) send({ do: "camera", zoom: [wide / wider], pan: [(x - nextX) / height, (nextY - y) / height] });
  };

  picture.draggable = false;
  addEventListener("resize", fit);
  stage.addEventListener("pointerdown", (event) => {
    if (event.target.closest("input, .divider")) return;
    stage.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    last = [event.clientX, event.clientY];
    if (fingers.size === 1) send({ do: "hold", on: true });
  });
  stage.addEventListener("pointermove", (event) => {
    const box = picture.hidden ? $("slider").under.getBoundingClientRect() : picture.getBoundingClientRect();
    if (!last) {
      const x = (event.clientX - box.left) / box.width;
      const y = (event.clientY - box.top) / box.height;
      if (x >= 0 && x < 1 && y >= 0 && y < 1 && event.timeStamp - lastRequest > 60) {
        lastRequest = event.timeStamp;
        position = { x, y };
        send({ do: "pixel", ...position });
      }
      return;
    }
    if (fingers.size > 1) return pinch(event, box.height);
    const across = (event.clientX - last[0]) / box.height;
    const down = (event.clientY - last[1]) / box.height;
    last = [event.clientX, event.clientY];
    if (event.shiftKey || event.buttons & 6) send({ do: "camera", pan: [-across, down] });
    else send({ do: "camera", orbit: [across * 3, down * 3] });
  });
  const release = (event) => {
    fingers.delete(event.pointerId);
    if (last && !fingers.size) send({ do: "hold", on: false });
    last = fingers.size ? [...fingers.values()][0] : null;
  };
  stage.addEventListener("pointerup", release);
  stage.addEventListener("pointercancel", release);
  stage.addEventListener("contextmenu", (event) => event.preventDefault());
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    moveCamera({ zoom: [Math.exp(Math.max(-1, Math.min(1, event.deltaY * 0.002)))] });
  }, { passive: false });

  const step = 0.1;
  const keys = {
    ArrowLeft: { orbit: [-step, 0] }, ArrowRight: { orbit: [step, 0] },
    ArrowUp: { orbit: [0, step] }, ArrowDown: { orbit: [0, -step] },
    "+": { zoom: [0.9] }, "=": { zoom: [0.9] }, "-": { zoom: [1 / 0.9] }, f: { frame: [] },
    w: { fly: [0, 0, 0.05] }, s: { fly: [0, 0, -0.05] }, a: { fly: [-0.05, 0, 0] }, d: { fly: [0.05, 0, 0] },
    q: { fly: [0, -0.05, 0] }, e: { fly: [0, 0.05, 0] },
  };
  stage.addEventListener("keydown", (event) => {
    const move = keys[event.key];
    if (!move || event.ctrlKey || event.metaKey || event.target.closest("input")) return;
    event.preventDefault();
    moveCamera(move);
  });
  $("map").addEventListener("change", () => { if (comparison) showComparison(comparison.facts, comparison.files); });
}

// The thumbnail of a port, in place of the statistics.
export function showSmall(name, source) {
  $("texture").replaceChildren(h("h2", {}, name), h("img", { src: source, alt: `${name}, small` }));
}

// Statistics of the shown texture.
export function showTexture(texture) {
  const container = $("texture");
  if (!texture) return;
  const names = ["R", "G", "B", "A"];
  const rows = texture.channels.map((channel, i) => {
    const most = Math.max(1, ...channel.histogram);
    const bars = h("div", { class: "histogram", role: "img", "aria-label": `Histogram of channel ${names[i]}` });
    for (const count of channel.histogram) {
      const bar = h("i");
      bar.style.height = `${(Math.sqrt(count / most) * 100).toFixed(1)}%`;
      bars.append(bar);
    }
    const text = `${names[i] ?? i}: ${short(channel.min)} … ${short(channel.max)}, mean ${short(channel.mean)}`;
    return h("div", {}, h("p", { class: "mono" }, text), bars);
  });
  const broken = texture.nan || texture.infinite
    ? h("p", { class: "mono broken" }, `${texture.nan} texels are NaN, ${texture.infinite} are infinite`) : null;
  const [channels, width, height, ...layers] = [...texture.shape].reverse();
  const about = [texture.semantic, texture.format, `${width}×${height}`, `channels: ${channels}`, ...layers.map((count) => `layers: ${count}`)].join(", ");
  container.replaceChildren(h("h2", {}, "Texture"), h("p", { class: "mono quiet" }, about), ...[broken, ...rows].filter(Boolean));
}
