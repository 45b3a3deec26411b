// Sub-pipelines in the graph: each is one card until it is opened. So is what a file inherits, where that is asked for.
const scopeOf = (id) => (id.includes("/") ? id.slice(0, id.lastIndexOf("/")) : "");

// The graph with one card for each sub-pipeline that is not opened, and for each of the `bases`: files by the nodes that
// are inherited from them. Its ports are those that lead out of it.
export function fold(graph, opened, bases = {}) {
  const outer = (id) => {  // the outermost closed sub-pipeline of a node, or the node itself
    const parts = scopeOf(id).split("/").filter(Boolean);
    const scope = parts.map((_, i) => parts.slice(0, i + 1).join("/")).find((one) => !opened.has(one));
    return bases[id] ? `from ${bases[id]}` : scope ?? id;
  };
  const cards = new Map();
  for (const node of graph.nodes) {
    const id = outer(node.id);
    if (id === node.id) cards.set(id, node);
    else {
      const card = cards.get(id) ?? { id, inner: [], ends: {}, type: "", family: node.family, inputs: {}, outputs: {} };
      card.inner.push(node);
      card.type = card.inner.length === 1 ? "1 node" : `${card.inner.length} nodes`;
      cards.set(id, card);
    }
  }
  const inside = (card, id) => (id.startsWith(`${card.id}/`) ? id.slice(card.id.length + 1) : id);
  const label = (card, id, port) => (card.inner ? `${inside(card, id)}.${port}` : port);
  const links = [];
  for (const link of graph.links) {
    const from = cards.get(outer(link.source)), to = cards.get(outer(link.target));
    if (from === to && from.inner) continue;
    const source_port = label(from, link.source, link.source_port), target_port = label(to, link.target, link.target_port);
    if (from.inner) {
      from.outputs[source_port] = from.inner.find((node) => node.id === link.source).outputs[link.source_port];
      from.ends[source_port] = `${link.source}.${link.source_port}`;
    }
    if (to.inner) to.inputs[target_port] = [];
    links.push({ ...link, source: from.id, target: to.id, source_port, target_port, own: link });
  }
  return { ...graph, nodes: [...cards.values()], links };
}

// The sub-pipelines that hold a node, the outermost first.
export function scopesOf(id) {
  const parts = scopeOf(id).split("/").filter(Boolean);
  return parts.map((_, i) => parts.slice(0, i + 1).join("/"));
}
