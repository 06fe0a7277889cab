// The page: what happens on keys, clicks and answers of the server.

import { Marks, ask } from "./marks.js";
import { Pictures, View } from "./view.js";

const part = id => document.getElementById(id);
// Colours that people with any colour vision tell apart (Okabe and Ito).
const COLOURS = ["#56b4e9", "#e69f00", "#009e73", "#f0e442", "#cc79a7", "#d55e00", "#0072b2", "#ffffff", "#999999"];

let job, marks, view, pictures;
let frame = 0;
let point = 0;

const say = text => { part("status").textContent = text; };

/* ---- who is there ---- */

const remembered = {
  get: () => { try { return localStorage.getItem(`zerre/${job.id}`) ?? ""; } catch { return ""; } },
  set: name => { try { localStorage.setItem(`zerre/${job.id}`, name); } catch { /* it is typed again next time */ } },
};

function askName() {
  part("app").inert = true;
  part("who").textContent = "";
  part("name-field").value = remembered.get();
  part("login-problem").textContent = "";
  part("take-over").hidden = true;
  const many = job.points.length > 1 ? `${job.points.length} points (${job.points.join(", ")})` : job.points[0];
  part("login-about").textContent = `${job.title}: ${job.frames.length} frames, to be marked: ${many}.`;
  part("login").showModal();
  part("name-field").select();
}

async function enter(name, takeOver) {
  const answer = await ask("login", { name, take_over: takeOver });
  const problem = part("login-problem");
  if (!answer.ok) {
    problem.textContent = answer.body.message;
    const may = ["known", "active"].includes(answer.body.error);
    const button = part("take-over");
    button.hidden = !may;
    button.textContent = answer.body.error === "active" ? `Take over as ${name.trim()}` : `Go on as ${name.trim()}`;
    (may ? button : part("name-field")).focus();
    return false;
  }
  begin(answer.body);
  return true;
}

function begin(login) {
  remembered.set(login.name);
  marks?.stop();
  marks = new Marks(job, login, { changed: show, taken, refused: why => say(`Not taken: ${why}.`) });
  part("who").textContent = marks.name;
  part("login").close();
  part("taken").close();
  part("app").inert = false;
  part("done").hidden = true;
  const open = nextOpen(-1);
  go(open ?? 0);
  part("picture").focus();
}

function taken(message) {
  const waiting = marks.pending.length;
  const kept = waiting ? ` ${waiting} ${waiting === 1 ? "answer" : "answers"} not saved yet: "Go on here" saves them.` : "";
  part("taken-text").textContent = message + kept;
  part("app").inert = true;
  part("taken").showModal();
}

function leave() {
  marks?.leave();
  marks = null;
  askName();
}

/* ---- frames and points ---- */

function nextOpen(from) {
  const count = job.frames.length;
  for (let step = 1; step <= count; step++) {
    const at = (from + step + count) % count;
    if (marks.answered(at) < job.points.length) return at;
  }
  return null;
}

function go(to, toPoint = 0) {
  frame = Math.min(job.frames.length - 1, Math.max(0, to));
  point = toPoint;
  const wanted = frame;
  view.picture = null;
  const curtain = part("curtain");
  const waiting = setTimeout(() => {
    if (wanted === frame && !view.picture) { curtain.textContent = "Loading…"; curtain.hidden = false; }
  }, 200);
  pictures.get(wanted).then(picture => {
    clearTimeout(waiting);
    if (wanted !== frame) return;
    curtain.hidden = true;
    view.picture = picture;
    view.draw();
    show();
    for (const near of [wanted + 1, wanted + 2, wanted - 1, wanted + 3]) {
      if (near >= 0 && near < job.frames.length) pictures.get(near).catch(() => {});
    }
  }, error => {
    clearTimeout(waiting);
    if (wanted !== frame) return;
    curtain.textContent = `This frame cannot be shown. ${error.message}`;
    curtain.hidden = false;
    show();
    setTimeout(() => { if (wanted === frame && !view.picture) go(wanted, point); }, 2000);
  });
  show();
}

/** To the next point of the frame without an answer, else to the next frame. */
function onward() {
  if (!part("advance").checked) return;
  const count = job.points.length;
  for (let step = 1; step < count; step++) {
    const at = (point + step) % count;
    if (!marks.answer(frame, at)) { point = at; show(); return; }
  }
  if (frame + 1 < job.frames.length) go(frame + 1);
  else show();
}

const decimals = value => (Math.round(value * 100) / 100).toString();

function answer(give, what) {
  if (!marks || marks.stopped) return;
  if (!view.picture) { say("There is no picture yet: nothing was marked."); return; }
  const [name, number] = [job.points[point], frame + 1];
  give();
  onward();
  const all = marks.standing.size === marks.total();
  const end = all ? " All frames are answered." : ` Frame ${frame + 1} of ${job.frames.length}.`;
  say(`${name} ${what} in frame ${number}.${end}`);
}

const mark = place => {
  const [x, y] = place.map(value => Math.round(value * 1000) / 1000);
  answer(() => marks.mark(frame, point, x, y), `marked at ${decimals(x)}, ${decimals(y)}`);
};
const hide = () => answer(() => marks.hide(frame, point), "not visible");

function undo() {
  if (!marks || marks.stopped) return;
  const last = marks.undo();
  if (!last) { say("There is nothing to undo."); return; }
  if (last.frame === frame) { point = last.point; show(); } else go(last.frame, last.point);
  say(`Undone: ${job.points[last.point]} in frame ${last.frame + 1}.`);
}

function jump() {
  const open = nextOpen(frame);
  if (open === null) { say("All frames are answered."); return; }
  const first = job.points.findIndex((_, k) => !marks.answer(open, k));
  go(open, Math.max(0, first));
  say(`Frame ${open + 1} of ${job.frames.length}.`);
}

/* ---- what is shown ---- */

function show() {
  if (!marks) return;
  const count = job.frames.length;
  const given = marks.standing.size;
  part("number").textContent = `${frame + 1} / ${count}`;
  part("name").textContent = job.frames[frame];
  part("frame").value = frame;
  part("frame").setAttribute("aria-valuetext", `frame ${frame + 1} of ${count}, ${job.frames[frame]}`);
  part("progress").max = marks.total();
  part("progress").value = given;
  part("count").textContent = `${given} of ${marks.total()} answered`;
  part("undo").disabled = !marks.history.length;
  part("previous").disabled = part("first").disabled = frame === 0;
  part("next").disabled = part("last").disabled = frame === count - 1;
  const done = part("done");
  done.hidden = given < marks.total();
  done.textContent = marks.pending.length
    ? `All ${count} frames are answered. Leave this window open until all is saved.`
    : `All ${count} frames are answered. Thank you, ${marks.name}! Any answer can still be changed.`;
  showSaved();
  showPoints();
  view.marks = job.points.map((name, k) => {
    const event = marks.answer(frame, k);
    return event?.kind === "mark" && {
      place: [event.x, event.y], name: job.points.length > 1 ? name : "", colour: COLOURS[k % COLOURS.length], active: k === point,
    };
  }).filter(Boolean);
  const badge = part("badge");
  badge.hidden = marks.answer(frame, point)?.kind !== "hidden";
  badge.textContent = `${job.points[point]}: not visible`;
  view.draw();
  showPlace();
  strip();
}

function showSaved() {
  const waiting = marks.pending.length;
  const { trouble } = marks;
  const answers = waiting === 1 ? "1 answer" : `${waiting} answers`;
  let [state, text] = ["good", "All saved"];
  if (trouble?.error === "silent") {
    state = "warn";
    text = waiting
      ? `The server does not answer: ${answers} not saved yet, kept in this browser`
      : "The server does not answer. Answers are kept in this browser meanwhile";
  } else if (trouble) {
    state = "bad";
    text = waiting ? `${answers} not saved yet. ${trouble.message}` : trouble.message;
  } else if (waiting) {
    [state, text] = ["busy", `Saving ${answers}…`];
  }
  if (waiting && !marks.kept) text += ". This browser may not store anything: do not close the window";
  const chip = part("saved");
  if (part("saved-text").textContent === text) return;
  const told = chip.dataset.state;
  chip.dataset.state = state;
  part("saved-text").textContent = text;
  if (["warn", "bad"].includes(state) || ["warn", "bad"].includes(told)) say(text);
}

function showPoints() {
  part("points-part").hidden = job.points.length < 2;
  job.points.forEach((_, k) => {
    const event = marks.answer(frame, k);
    part(`point-${k}`).checked = k === point;
    part(`said-${k}`).textContent = !event ? "open" : event.kind === "mark" ? "marked" : "not visible";
  });
}

function showPlace() {
  const [x, y] = view.at;
  part("place").textContent = `x ${x.toFixed(2)}   y ${y.toFixed(2)}`;
  part("zoom").textContent = view.scale >= 10 ? `${Math.round(view.scale)} ×` : `${view.scale.toFixed(2)} ×`;
}

/** All frames in a row: what is answered, what is not. */
function strip() {
  const canvas = part("strip");
  const { width, height } = canvas.getBoundingClientRect();
  const ratio = devicePixelRatio || 1;
  const [wide, high] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
  if (canvas.width !== wide) canvas.width = wide;
  if (canvas.height !== high) canvas.height = high;
  const pen = canvas.getContext("2d");
  const style = getComputedStyle(document.documentElement);
  const ink = name => style.getPropertyValue(name).trim();
  const [open, full, hidden] = ["--sunken", "--mark", "--hidden"].map(ink);
  pen.fillStyle = open;
  pen.fillRect(0, 0, wide, high);
  const count = job.frames.length;
  const step = wide / count;
  const gap = step > 5 ? ratio : 0;
  for (let at = 0; at < count; at++) {
    const events = job.points.map((_, k) => marks.answer(at, k)).filter(Boolean);
    if (!events.length) continue;
    const share = events.length / job.points.length;
    pen.fillStyle = events.every(event => event.kind === "hidden") ? hidden : full;
    pen.fillRect(at * step, high * (1 - share), Math.max(1, step - gap), high * share);
  }
}

function save(text, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

/* ---- keys and buttons ---- */

const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

function onKey(event) {
  if (!marks || marks.stopped || document.querySelector("dialog[open]")) return;
  if (event.altKey || event.metaKey) {
    if (!(event.metaKey && event.key === "z")) return;
  }
  const { target, key } = event;
  const typing = target.matches?.("input, select, textarea");
  const pressing = target.matches?.("button, a");
  const far = event.shiftKey ? 10 : 1;
  const lower = key.length === 1 ? key.toLowerCase() : key;
  let act;
  if ((event.ctrlKey || event.metaKey) && lower === "z") act = undo;
  else if (event.ctrlKey) return;
  else if (steps[key] && !typing) act = () => view.step(steps[key][0] * far, steps[key][1] * far);
  else if ((key === "Enter" || key === " ") && !typing && !pressing) act = () => mark(view.at);
  else if (lower === "n") act = hide;
  else if (lower === "u") act = undo;
  else if (lower === "j") act = jump;
  else if ([",", "<", "[", "{"].includes(key)) act = () => go(frame - far, point);
  else if ([".", ">", "]", "}"].includes(key)) act = () => go(frame + far, point);
  else if (key === "Home") act = () => go(0);
  else if (key === "End") act = () => go(job.frames.length - 1);
  else if (key === "+" || key === "=") act = () => view.zoom(1.25);
  else if (key === "-" || key === "_") act = () => view.zoom(0.8);
  else if (key === "0") act = () => { view.fit(); showPlace(); };
  else if (key === "?") act = () => part("help").showModal();
  else if (/^[1-9]$/.test(key) && +key <= job.points.length) act = () => { point = +key - 1; show(); };
  if (!act) return;
  event.preventDefault();
  // A key that is held down would answer frame after frame unseen.
  if (event.repeat && [hide, undo].includes(act)) return;
  if (event.repeat && (key === "Enter" || key === " ")) return;
  act();
}

function onClick(id, act) { part(id).addEventListener("click", () => { if (marks && !marks.stopped) act(); }); }

async function start() {
  const answer = await ask("job");
  if (!answer.ok) {
    part("title").textContent = answer.body.message;
    setTimeout(start, 2000);
    return;
  }
  job = answer.body;
  document.title = `${job.title} · zerre label`;
  part("title").textContent = job.title;
  part("frame").max = job.frames.length - 1;
  job.points.forEach((name, k) => {
    const label = document.createElement("label");
    const radio = Object.assign(document.createElement("input"), { type: "radio", name: "point", id: `point-${k}` });
    radio.addEventListener("change", () => { point = k; show(); });
    const swatch = Object.assign(document.createElement("span"), { className: "swatch" });
    swatch.style.setProperty("background", COLOURS[k % COLOURS.length]);
    const said = Object.assign(document.createElement("span"), { className: "said", id: `said-${k}` });
    label.append(radio, swatch, document.createTextNode(name), said);
    part("points").append(label);
  });
  pictures = new Pictures(job.size);
  view = new View(part("picture"), part("lens"), job.size, { moved: showPlace, clicked: mark });
  document.addEventListener("keydown", onKey);
  for (const [id, act] of [
    ["mark", () => mark(view.at)], ["hide", hide], ["undo", undo], ["jump", jump],
    ["first", () => go(0)], ["previous", () => go(frame - 1, point)], ["next", () => go(frame + 1, point)],
    ["last", () => go(job.frames.length - 1)],
    ["zoom-in", () => view.zoom(1.25)], ["zoom-out", () => view.zoom(0.8)],
    ["zoom-fit", () => { view.fit(); showPlace(); }],
    ["help-button", () => part("help").showModal()], ["leave", leave],
    ["export", () => save(marks.csv(), `labels-${marks.name}.csv`)],
  ]) onClick(id, act);
  part("frame").addEventListener("input", event => go(+event.target.value, point));
  // A click on the picture gives it the keys.
  part("picture").addEventListener("pointerdown", () => part("picture").focus());
  part("login-form").addEventListener("submit", event => { event.preventDefault(); enter(part("name-field").value, false); });
  part("name-field").addEventListener("input", () => { part("take-over").hidden = true; part("login-problem").textContent = ""; });
  part("take-over").addEventListener("click", () => enter(part("name-field").value, true));
  part("taken-leave").addEventListener("click", () => { part("taken").close(); leave(); });
  part("taken-back").addEventListener("click", async () => {
    if (!await enter(marks.name, true)) part("taken-text").textContent = part("login-problem").textContent;
  });
  for (const id of ["login", "taken"]) part(id).addEventListener("cancel", event => event.preventDefault());
  addEventListener("resize", () => { if (marks) strip(); });
  addEventListener("pagehide", () => marks?.leave());
  addEventListener("pageshow", event => { if (event.persisted) location.reload(); });
  addEventListener("beforeunload", event => { if (marks?.pending.length && !marks.kept) event.preventDefault(); });
  askName();
}

start();
