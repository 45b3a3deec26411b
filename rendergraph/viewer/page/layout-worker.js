// Lays out graphs beside the page, which stays responsive.
globalThis.document ??= {};  // else ELK takes itself for the worker, and this file for nothing
importScripts("vendor/elk.bundled.js");

const elk = new globalThis.ELK();

onmessage = async ({ data: { id, graph } }) => {
  postMessage({ id, layout: await elk.layout(graph) });
};
