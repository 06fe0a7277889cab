const part = id => document.getElementById(id);
const [stage, frame, box] = ["stage", "frame", "box"].map(part);
const fields = ["x", "y", "w", "h"].map(part);
let from = null;
const place = event => {
  const seen = frame.getBoundingClientRect();
  const at = (p, start, length, pixels) => Math.min(Math.max((p - start) / length, 0), 1) * pixels;
  return [at(event.clientX, seen.left, seen.width, frame.naturalWidth),
          at(event.clientY, seen.top, seen.height, frame.naturalHeight)];
};
const draw = () => {
  const [x, y, w, h] = fields.map(field => parseFloat(field.value));
  const scale = frame.clientWidth / frame.naturalWidth;
  const good = [x, y, w, h].every(Number.isFinite);
  box.style.display = good ? "block" : "none";
  if (good) Object.assign(box.style,
    { left: x * scale + "px", top: y * scale + "px", width: w * scale + "px", height: h * scale + "px" });
};
stage.onpointerdown = event => { from = place(event); stage.setPointerCapture(event.pointerId); };
stage.onpointermove = event => {
  if (!from) return;
  const to = place(event);
  const [x, y] = [Math.min(from[0], to[0]), Math.min(from[1], to[1])];
  [x, y, Math.abs(to[0] - from[0]), Math.abs(to[1] - from[1])]
    .forEach((value, i) => { fields[i].value = Math.round(value); });
  draw();
};
stage.onpointerup = () => { from = null; };
fields.forEach(field => { field.oninput = draw; });
window.onresize = draw;
part("form").onsubmit = async event => {
  event.preventDefault();
  const answer = await fetch("box", { method: "POST", body: fields.map(field => field.value).join(",") });
  part("answer").textContent = (await answer.text()) + (answer.ok ? " This page may be closed." : "");
};
