// The connection to the server: JSON both ways, pictures with a JSON header. It reconnects by itself.
import { $ } from "./dom.js";

const handlers = new Map();
let socket = null;
let delay = 250;

export const on = (kind, act) => handlers.set(kind, act);

export function send(message) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

export function dispatch(kind, facts, files) {
  handlers.get(kind)?.(facts, files ?? {});
}

function unpack(buffer) {
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
  socket.onopen = () => { delay = 250; $("link").textContent = "live"; };
  socket.onmessage = ({ data }) => {
    const [facts, files] = typeof data === "string" ? [JSON.parse(data), {}] : unpack(data);
    dispatch(facts.kind, facts, files);
  };
  socket.onclose = () => {
    const again = delay > 2000 ? " If the server was started again, open the address that it printed." : "";
    $("link").textContent = `Connection lost, reconnecting …${again}`;
    setTimeout(connect, delay);
    delay = Math.min(delay * 2, 5000);
  };
}
