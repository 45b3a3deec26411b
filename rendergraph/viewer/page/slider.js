// Two pictures, divided by a line that a range input moves.
import { h } from "./dom.js";

class PictureSlider extends HTMLElement {
  connectedCallback() {
    if (this.firstChild) return;
    this.under = h("img", { alt: "The picture", draggable: "false" });
    this.over = h("img", { alt: "The picture it is compared with", class: "over", draggable: "false" });
    this.left = h("span", { class: "tag a" });
    this.right = h("span", { class: "tag b" });
    this.range = h("input", { type: "range", min: 0, max: 1000, value: 500, "aria-label": "Position of the dividing line" });
    this.range.addEventListener("input", () => this.cut());
    this.divider = h("div", { class: "divider" });
    this.append(h("div", { class: "pile" }, this.under, this.over, this.left, this.right, this.divider), this.range);
    this.divider.addEventListener("pointerdown", (event) => this.divider.setPointerCapture(event.pointerId));
    this.divider.addEventListener("pointermove", (event) => {
      if (!this.divider.hasPointerCapture(event.pointerId)) return;
      const { left, width } = this.under.getBoundingClientRect();
      this.range.value = ((event.clientX - left) / width) * 1000;
      this.cut();
    });
    this.range.addEventListener("pointerdown", (event) => event.stopPropagation());
    this.cut();
  }

  cut() {
    this.over.style.clipPath = `inset(0 0 0 ${this.range.value / 10}%)`;
    this.divider.style.left = `${this.range.value / 10}%`;
  }

  show(mine, other, names) {
    this.under.src = mine;
    if (other) this.over.src = other;
    [this.left.textContent, this.right.textContent] = names;
  }
}

customElements.define("picture-slider", PictureSlider);
