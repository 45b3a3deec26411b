// Make elements. Text is always text, never markup, whatever a file names its nodes.
export const $ = (id) => document.getElementById(id);

const SVG = "http://www.w3.org/2000/svg";

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes ?? {})) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

export const h = (tag, attributes, ...children) => fill(document.createElement(tag), attributes, children);
export const s = (tag, attributes, ...children) => fill(document.createElementNS(SVG, tag), attributes, children);

// Fill a drop-down list, and select an entry.
export function choices(select, words, chosen, label = (word) => word) {
  const same = select.options.length === words.length && words.every((word, i) => select.options[i].value === word);
  if (!same) select.replaceChildren(...words.map((word) => h("option", { value: word }, label(word))));
  select.value = chosen;
}

// A number in a few digits.
export function short(value) {
  if (typeof value !== "number") return String(value ?? "–");
  return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(5)));
}
