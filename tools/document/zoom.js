
// A stretch of time, drawn over one picture, is shown in all: points are moved, and ticks say the times where they stand.
const parts = [...document.querySelectorAll(".trihedron-picture")].map(svg => {
  const box = svg.querySelector("clipPath rect");
  const ticks = [...svg.querySelectorAll("text")].map(text => ({
    text, shown: text.textContent, at: +text.getAttribute("x"), time: Number(text.textContent.trim().replace("\u2212", "-")),
  })).filter(tick => /anchor: middle/.test(tick.text.getAttribute("style")) && tick.shown.trim() && isFinite(tick.time));
  const lines = [...svg.querySelectorAll("path[clip-path]")].filter(path => !/#dce1e6/.test(path.getAttribute("style")))
    .map(path => ({ path, d: path.getAttribute("d") }));
  return { svg, ticks, lines, left: +box?.getAttribute("x"), width: +box?.getAttribute("width") };
}).filter(part => part.width && part.ticks.length > 1);
let [from, to] = [0, 1];
function show(low, high) {
  [from, to] = [low, high];
  const whole = low === 0 && high === 1;
  for (const { ticks, lines, left, width } of parts) {
    const [first, last] = [ticks[0], ticks[ticks.length - 1]];
    const perUnit = (last.time - first.time) / (last.at - first.at);
    const places = Math.min(9, Math.max(0, Math.ceil(2 - Math.log10(Math.abs(perUnit) * width * (high - low)))));
    for (const { path, d } of lines) path.setAttribute("d", whole ? d : d.replace(/(-?[\d.]+) (-?[\d.]+)/g,
      (_, x, y) => `${(left + ((x - left) / width - low) / (high - low) * width).toFixed(2)} ${y}`));
    for (const { text, shown, at } of ticks) text.textContent = whole ? shown :
      (first.time + perUnit * (left + width * (low + (at - left) / width * (high - low)) - first.at)).toFixed(places);
  }
}
for (const { svg, left, width } of parts) {
  const part = event => {
    const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return Math.min(1, Math.max(0, (place.x - left) / width));
  };
  const stretch = document.createElementNS("http://www.w3.org/2000/svg", "rect");
  stretch.setAttribute("class", "stretch");
  stretch.setAttribute("height", "100%");
  let began = null;
  svg.classList.add("zoomed");
  svg.addEventListener("pointerdown", event => { began = part(event); svg.setPointerCapture(event.pointerId); });
  svg.addEventListener("pointermove", event => {
    if (began === null) return;
    stretch.setAttribute("x", left + width * Math.min(began, part(event)));
    stretch.setAttribute("width", width * Math.abs(part(event) - began));
    svg.append(stretch);
  });
  svg.addEventListener("pointerup", event => {
    const [low, high] = [began, part(event)].sort((a, b) => a - b).map(at => from + at * (to - from));
    began = null;
    stretch.remove();
    if (high - low > 0.01 * (to - from)) show(low, high);
  });
  svg.addEventListener("dblclick", () => show(0, 1));
}
if (parts.length) document.querySelector(".zoom").hidden = false;
