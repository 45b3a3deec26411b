// The one connection: JSON both ways, pictures with a JSON head; it comes back by itself.
import { $ } from "./dom.js";

const heard = new Map();
let socket = null;
let pause = 250;

export const on = (kind, act) => heard.set(kind, act);

export function send(message) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

export function tell(kind, facts, files) {
  heard.get(kind)?.(facts, files ?? {});
}

function unpacked(buffer) {
  const size = new DataView(buffer).getUint32(0, true);
  const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
  const files = {};
  let at = 4 + size;
  for (const [name, length] of Object.entries(facts.files)) {
    files[name] = new Blob([new Uint8Array(buffer, at, length)]);
    at += length;
  }
  return [facts, files];
}

export function connect() {
  const place = new URL("socket", document.baseURI);
  place.protocol = place.protocol === "https:" ? "wss:" : "ws:";
  socket = new WebSocket(place);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { pause = 250; $("link").textContent = "live"; };
  socket.onmessage = ({ data }) => {
    const [facts, files] = typeof data === "string" ? [JSON.parse(data), {}] : unpacked(data);
    tell(facts.kind, facts, files);
  };
  socket.onclose = () => {
    $("link").textContent = "connection lost, trying again …";
    setTimeout(connect, pause);
    pause = Math.min(pause * 2, 5000);
  };
}
