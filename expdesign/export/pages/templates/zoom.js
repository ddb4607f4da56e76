
// Charts zoom by wheel, buttons and keys, and move by dragging; without this script they are whole.
for (const figure of document.querySelectorAll("figure.zoom")) {
  const svg = figure.querySelector("svg");
  if (!svg) continue;
  const whole = svg.getAttribute("viewBox").split(" ").map(Number);
  let box = whole.slice();
  const show = () => svg.setAttribute("viewBox", box.join(" "));
  const at = (event) => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return [point.x, point.y];
  };
  const clamp = () => {
    for (const i of [0, 1]) box[i] = Math.min(Math.max(box[i], whole[i]), whole[i] + whole[i + 2] - box[i + 2]);
    show();
  };
  const zoom = (factor, [x, y] = [box[0] + box[2] / 2, box[1] + box[3] / 2]) => {
    const scale = Math.min(Math.max(box[2] * factor, whole[2] / 40), whole[2]) / box[2];
    box = [x - (x - box[0]) * scale, y - (y - box[1]) * scale, box[2] * scale, box[3] * scale];
    clamp();
  };
  const move = (x, y) => { box[0] += x; box[1] += y; clamp(); };
  const reset = () => { box = whole.slice(); show(); };
  const tools = document.createElement("div");
  tools.className = "tools";
  for (const [sign, label, act] of [["+", "Zoom in", () => zoom(0.6)], ["\u2212", "Zoom out", () => zoom(1 / 0.6)], ["\u2302", "Whole chart", reset]]) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = sign;
    button.setAttribute("aria-label", label);
    button.title = label;
    button.addEventListener("click", act);
    tools.append(button);
  }
  figure.prepend(tools);
  svg.tabIndex = 0;
  svg.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && box[2] >= whole[2] && event.deltaY > 0) return; // the page scrolls on from a whole chart
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.25 : 0.8, at(event));
  }, { passive: false });
  svg.addEventListener("keydown", (event) => {
    const step = box[2] / 8;
    const act = { "+": () => zoom(0.6), "-": () => zoom(1 / 0.6), "0": reset, ArrowLeft: () => move(-step, 0),
      ArrowRight: () => move(step, 0), ArrowUp: () => move(0, -step), ArrowDown: () => move(0, step) }[event.key];
    if (act) { event.preventDefault(); act(); }
  });
  let held = null;
  svg.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "touch" && box[2] < whole[2]) { held = at(event); svg.setPointerCapture(event.pointerId); }
  });
  svg.addEventListener("pointermove", (event) => { if (held) { const [x, y] = at(event); move(held[0] - x, held[1] - y); } });
  for (const name of ["pointerup", "pointercancel"]) svg.addEventListener(name, () => { held = null; });
  svg.addEventListener("dblclick", reset);
}
