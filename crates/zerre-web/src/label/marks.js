// What one operator has marked: what the server has saved, what waits to be saved, and how it gets there.
// Every mark is an event with a name of its own, so that sending it twice is as good as once.

const RETRY_MS = 1500;
const ALIVE_MS = 5000;
const BATCH = 200;

/** Asks the server. Answers {ok, status, body}; status 0 when it does not answer. */
export async function ask(path, body) {
  try {
    const answer = await fetch(path, body === undefined ? {} :
      { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
    const text = await answer.text();
    let value;
    try { value = JSON.parse(text); } catch { value = { error: "fault", message: text }; }
    return { ok: answer.ok, status: answer.status, body: value };
  } catch {
    return { ok: false, status: 0, body: { error: "silent", message: "The server does not answer." } };
  }
}

const random = () => Array.from(crypto.getRandomValues(new Uint8Array(9)), b => b.toString(16).padStart(2, "0")).join("");

export class Marks {
  /** `changed()` is called whenever there is something else to show, `taken(message)` when another window took over. */
  constructor(job, login, { changed, taken, refused }) {
    Object.assign(this, { job, changed, taken, refused, name: login.name, session: login.session });
    this.events = login.events;
    this.pending = [];
    this.trouble = null;
    this.stopped = false;
    this.sending = false;
    this.kept = true;
    this.prefix = `zerre/${job.id}/${login.name.toLowerCase()}/`;
    this.place = this.prefix + random();
    this.adopt();
    this.sum();
    this.timer = setInterval(() => this.beat(), ALIVE_MS);
    this.flush();
  }

  /** Takes over what an earlier window of this name could not save. */
  adopt() {
    const known = new Set(this.events.map(event => event.id));
    try {
      const places = Object.keys(localStorage).filter(key => key.startsWith(this.prefix)).sort();
      const found = places.flatMap(place => JSON.parse(localStorage.getItem(place) || "[]"));
      // Within a window they are in their order already, which a stable sort keeps.
      for (const event of found.sort((a, b) => a.order - b.order)) {
        if (!known.has(event.id)) { known.add(event.id); this.pending.push(event); this.events.push(event); }
      }
      this.keep();
      if (this.kept) places.filter(place => place !== this.place).forEach(place => localStorage.removeItem(place));
    } catch { this.kept = false; }
  }

  /** Writes what is not saved yet where a crash of the browser leaves it. */
  keep() {
    try {
      if (this.pending.length) localStorage.setItem(this.place, JSON.stringify(this.pending));
      else localStorage.removeItem(this.place);
      this.kept = true;
    } catch { this.kept = false; }
  }

  /** Sums the events up: the last answer that was not undone holds. */
  sum() {
    const undone = new Set(this.events.filter(event => event.kind === "undo").map(event => event.undoes));
    this.standing = new Map();
    this.history = this.events.filter(event => event.kind !== "undo" && !undone.has(event.id));
    for (const event of this.history) this.standing.set(event.frame * this.job.points.length + event.point, event);
  }

  /** The answer on a point in a frame: an event of kind mark or hidden, or nothing. */
  answer(frame, point) { return this.standing.get(frame * this.job.points.length + point); }

  /** How many points of a frame are answered. */
  answered(frame) { return this.job.points.filter((_, point) => this.answer(frame, point)).length; }

  total() { return this.job.frames.length * this.job.points.length; }

  add(event) {
    const whole = { id: random(), order: Date.now(), ...event };
    this.events.push(whole);
    this.pending.push(whole);
    this.keep();
    this.sum();
    this.changed();
    this.flush();
  }

  mark(frame, point, x, y) { this.add({ kind: "mark", frame, point, x, y }); }
  hide(frame, point) { this.add({ kind: "hidden", frame, point }); }

  /** Takes the last answer back and says which it was. */
  undo() {
    const last = this.history.at(-1);
    if (last) this.add({ kind: "undo", undoes: last.id });
    return last;
  }

  async flush() {
    if (this.sending || this.stopped || !this.pending.length) return;
    this.sending = true;
    const batch = this.pending.slice(0, BATCH);
    const events = batch.map(({ order, ...event }) => event);
    const answer = await ask("events", { session: this.session, events });
    this.sending = false;
    if (this.stopped) return;
    if (answer.ok) {
      const refused = new Map(answer.body.refused.map(({ id, why }) => [id, why]));
      const done = new Set([...answer.body.saved, ...refused.keys()]);
      this.pending = this.pending.filter(event => !done.has(event.id));
      if (refused.size) {
        this.events = this.events.filter(event => !refused.has(event.id));
        this.sum();
        this.refused([...refused.values()].join("; "));
      }
      this.trouble = null;
      this.keep();
      this.changed();
      if (done.size) this.flush();
      return;
    }
    this.fail(answer);
    if (!this.stopped) setTimeout(() => this.flush(), RETRY_MS);
  }

  async beat() {
    if (this.pending.length) return this.flush();
    const answer = await ask("alive", { session: this.session });
    if (this.stopped) return;
    if (answer.ok) {
      if (this.trouble) { this.trouble = null; this.changed(); }
    } else this.fail(answer);
  }

  fail({ body }) {
    if (body.error === "taken") {
      this.stop();
      this.taken(body.message);
      return;
    }
    if (this.trouble?.error !== body.error) { this.trouble = body; this.changed(); }
  }

  stop() {
    this.stopped = true;
    clearInterval(this.timer);
  }

  leave() {
    this.stop();
    navigator.sendBeacon?.("alive", JSON.stringify({ session: this.session, leaving: true }));
  }

  /** The operator's own marks as a table. */
  csv() {
    const quoted = text => /[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
    const rows = [...this.standing.entries()].sort(([a], [b]) => a - b).map(([, e]) => [
      quoted(this.job.frames[e.frame]), quoted(this.name), quoted(this.job.points[e.point]),
      e.x ?? "", e.y ?? "", e.kind === "mark" ? 1 : 0].join(","));
    return ["frame,operator,point,x,y,visible", ...rows, ""].join("\n");
  }
}
