"use strict";
const $ = id => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";
const FACES = ["", "+1", "-1", "+2", "-2", "+3", "-3"];
const ASKS = /--set ([\w.]+)=/;
const MOST_ROWS = 60, READING = "is being read";
const HEIGHT = 176, LEFT = 64, BELOW = 18;
let WIDTH = 1000;
let state = { number: -1, files: [], answers: [] }, current = 0, chosen = new Set([0]), span = null, rests = [], marks = [];
let lostSince = null, ended = false, timer = 0;
let lines = null, shownFiles = "", shownRecord = "", shownAnswer = -1, shownContent = "", selected = null, lastCommand = "";
// Numbers of the answer that is shown, and of the one that was asked for last; null until it is shown.
let answerNumber = null, askedNumber = null;

// Requests

async function get(name) {
  const answer = await fetch(name, { cache: "no-store" });
  if (!answer.ok) throw new Error(answer.status);
  return answer.json();
}

async function send(content) {
  for (const input of document.querySelectorAll("[aria-invalid]")) input.removeAttribute("aria-invalid");
  $("refusal").textContent = $("note").textContent = "";
  const answer = await fetch("do", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(content) });
  const result = await answer.json();
  if (result.refusal) refuse(result.refusal);
  await poll();
  return result;
}

function connection(good) {
  lostSince = good ? null : lostSince || new Date();
  $("lost").hidden = good;
  $("lost").textContent = ended ? "The measurement has ended. Its end is shown below."
    : good ? "" : `The connection to the program is lost since ${lostSince.toLocaleTimeString()}. What is shown below is old. Look at the terminal of the program.`;
}

async function look() {
  try {
    const fresh = await get(`state?number=${state.number}`);
    state = { ...state, ...fresh };
    if (fresh.answers && state.asked !== askedNumber && state.answers[state.asked].answer) answerNumber = askedNumber = state.asked;
    connection(true);
    if (fresh.files) show(); else showRunning();
  } catch (error) {
    connection(false);
  }
}

// An answer is looked for soon after it was asked for.
async function poll() {
  clearTimeout(timer);
  await look();
  clearTimeout(timer);
  timer = setTimeout(poll, !state.running ? 1000 : state.running.seconds < 1 ? 100 : 250);
}

function options() {
  const values = {};
  for (const input of document.querySelectorAll("#options input, #more input"))
    if (input.value.trim()) values[input.name] = input.value.trim();
  if ($("trust").checked) values.trust = true;
  return values;
}

function chosenFiles() {
  const files = [...chosen].filter(number => state.files[number] && state.files[number].about);
  return files.sort((a, b) => a - b);
}

function run(command) {
  lastCommand = command;
  askedNumber = null;
  return send({ do: "run", command, files: chosenFiles(), options: options() });
}

// A line why something cannot be done; where a person may insist, with the button for it.
function refuse(text) {
  $("refusal").textContent = text;
  const asked = [...document.querySelectorAll("#options input, #more input")].filter(one => text.includes(`--${one.name.replaceAll("_", "-")}`));
  for (const input of asked) input.setAttribute("aria-invalid", "true");
  if (asked.length) { const more = asked[0].closest("details"); if (more) more.open = true; asked[0].focus(); }
  if (text.includes("--trust") && lastCommand) $("refusal").append(" ", button("Use it all the same", () => { $("trust").checked = true; run(lastCommand); }));
}

// New content of a part; the keyboard stays where it was, or at what took its place.
function renew(part, content) {
  const focused = document.activeElement, label = part.contains(focused) && focused.getAttribute("aria-label");
  const place = label ? labelled(part).indexOf(focused) : -1;
  part.replaceChildren(...content);
  if (place < 0) return;
  const fresh = labelled(part);
  const next = fresh.find(one => one.getAttribute("aria-label") === label) || fresh[Math.min(place, fresh.length - 1)];
  if (next) next.focus({ preventScroll: true });
}

const labelled = part => [...part.querySelectorAll("[aria-label]")].filter(one => one.matches("button, input, select"));

function decide(change, file = current) {
  const decisions = { ...state.files[file].decisions, ...change };
  return send({ do: "decide", file, decisions });
}

// The answer that is shown, with its command and files; those about the same files; positions that answers call wrong.
const entry = () => answerNumber === null ? null : state.answers[answerNumber];
const beside = () => state.answers.filter(one => one.answer && String(one.files) === String(entry().files));
const wrongIn = file => [...new Set(state.answers.flatMap(one => one.answer && one.files[0] === file ? one.answer.wrong : []))];

// What is shown

function element(name, content, attributes = {}) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (content instanceof Node) made.append(content); else if (content !== null) made.textContent = content;
  return made;
}

function cell(content, look = "") {
  return element("td", content, look ? { class: look } : {});
}

function button(text, act, title) {
  const made = element("button", text, { type: "button", class: "plain" });
  if (title) made.setAttribute("aria-label", title);
  made.addEventListener("click", act);
  return made;
}

function showRunning() {
  const running = state.running, old = state.answers.filter(one => one.outdated && one.answer), shown = entry();
  $("running").hidden = !running && !old.length;
  $("answer-part").classList.toggle("old", Boolean(shown) && (shown.outdated || shown.running));
  const words = running ? [`Running for ${running.seconds} s: ${[...running.commands, ...running.waiting].join(", then ")}.`] : [];
  if (old.length) words.push(`Older than your last change: ${old.map(one => one.command).join(", ")}.`);
  $("running").firstElementChild.textContent = words.join(" ");
  $("running").lastElementChild.textContent = running ? "Stop" : "Calculate again";
}

function show() {
  showFiles();
  showRunning();
  if (state.refusal && $("refusal").textContent !== state.refusal) refuse(state.refusal);
  const file = state.files[current];
  for (const one of document.querySelectorAll("#commands button")) one.disabled = !chosenFiles().length || state.files.some(file => file.problem === READING);
  if (!entry()) $("verdict").textContent = !file ? "Open a record, then choose what to do." : file.about ? "Choose what to do." : file.imported || ASKS.test(file.problem) ? "First make a record of the file: see below." : file.problem === READING ? "The file is being read." : "This file cannot be used: see below.";
  $("record-part").hidden = !file;
  if (file) {
    const key = JSON.stringify([current, file.preview, file.about && file.about.sha256, file.decisions, file.problem, wrongIn(current), file.imported]);
    if (key !== shownRecord) { shownRecord = key; showRecord(file); }
    $("undo").disabled = !file.undo;
  }
  const content = JSON.stringify([answerNumber, state.answers]);
  if (content !== shownContent) { shownContent = content; showAnswer(); }
  shownAnswer = state.answered;
}

function lookAt(number) {
  const known = state.answers.findLastIndex(one => one.answer && String(one.files) === String(number));
  if (known >= 0) answerNumber = known;
  current = number;
  span = selected = null;
  show();
}

function showFiles() {
  $("files-part").hidden = !state.files.length;
  const key = JSON.stringify([current, [...chosen], state.files.map(file => [file.name, file.about && file.about.rows, file.problem, file.outcome])]);
  if (key === shownFiles) return;
  shownFiles = key;
  renew($("files").tBodies[0], state.files.map((file, number) => {
    const row = element("tr", null), about = file.about, outcome = file.outcome, tick = element("input", null, { type: "checkbox", "aria-label": `Calculate with ${file.name}` });
    tick.checked = chosen.has(number);
    tick.disabled = !about;
    tick.addEventListener("change", () => { tick.checked ? chosen.add(number) : chosen.delete(number); show(); });
    const open = button(file.name, () => { if (chosen.size < 2) chosen = new Set([number]); lookAt(number); }, `Look at ${file.name}`);
    open.setAttribute("aria-current", String(number === current));
    const [said, ...rest] = outcome ? outcome.verdict.replace(`${file.name}: `, "").split(/[:.]\s|\.$/) : [""];
    const verdict = outcome ? `${outcome.command}${outcome.together ? ", together" : ""}: ${said}` : "";
    const keys = outcome ? Object.entries(outcome.key).slice(0, 3).map(([name, value]) => `${name} ${value}`) : [];
    const figures = (keys.length ? keys : rest.filter(Boolean)).join("; ");
    const kind = about ? about.word : file.problem === READING ? "is being read" : "not a record yet";
    const seconds = about && about.seconds !== null ? String(Number(about.seconds.toPrecision(6))) : "";
    row.append(cell(tick), cell(open), cell(kind), cell(about ? String(about.rows) : "", "number"), cell(seconds, "number"), cell(verdict), cell(figures));
    return row;
  }));
}

function showAnswer() {
  const answer = entry() && entry().answer;
  for (const part of ["how", "page"]) $(`${part}-part`).hidden = !answer;
  $("explanations-part").hidden = !answer || !answer.explanations.length;
  if (!answer) return;
  showAnswers();
  showBefore();
  $("answer-about").textContent = answer.command;
  $("verdict").textContent = answer.verdict;
  $("verdict").className = `verdict ${answer.tone}`;
  $("key").replaceChildren(...Object.entries(answer.key).slice(0, 4).map(([name, value]) => {
    const part = element("div", null);
    part.append(element("dt", name), element("dd", String(value)));
    return part;
  }));
  $("sentences").replaceChildren(...answer.sentences.map(text => element("p", text)));
  const act = [];
  for (const one of document.querySelectorAll("#saves [data-gives]")) one.hidden = !answer.gives.includes(one.dataset.gives);
  if (answer.wrong.length) {
    const names = answer.wrong.join(", ");
    act.push(button(`Leave out position ${names}`, () => {
      const file = entry().files[0], kept = state.files[file].decisions.left_out || [];
      decide({ left_out: [...new Set([...kept, ...answer.wrong])] }, file);
    }));
  }
  $("act").replaceChildren(...act);
  $("following").hidden = !answer.next;
  $("following").querySelector("code").textContent = answer.next;
  $("warnings").hidden = !answer.warnings.length;
  $("warnings").querySelector("summary").textContent = answer.warnings.length === 1 ? "1 warning" : `${answer.warnings.length} warnings`;
  $("warnings").querySelector("ul").replaceChildren(...answer.warnings.map(text => element("li", text)));
  const key = JSON.stringify([answerNumber, answer]);
  if ($("explanations").dataset.key !== key) $("explanations").replaceChildren(...answer.explanations.map((one, number) => showExplanation(one, number)));
  $("explanations").dataset.key = key;
  $("command").textContent = answer.command;
  $("python").textContent = answer.python;
  showPage();
}

// The answers about the same files, to choose from.
function showAnswers() {
  const every = beside();
  $("answers").hidden = every.length < 2;
  renew($("answers"), every.map(one => {
    const made = button(`${one.command[0].toUpperCase()}${one.command.slice(1)}: ${one.answer.verdict.split(/[:.]/)[0]}`, () => { answerNumber = state.answers.indexOf(one); show(); }, `Show the answer of ${one.command}`);
    made.setAttribute("aria-pressed", String(one === entry()));
    return made;
  }));
}

// The page of a result is drawn where somebody looks at it.
function showPage() {
  const address = `page?answer=${answerNumber}&at=${state.answered}`;
  if (!$("page-details").open || $("page").getAttribute("src") === address) return;
  $("drawing").hidden = false;
  $("page").setAttribute("src", address);
}

function showExplanation(explanation, number) {
  const item = element("li", null), details = element("details", null), summary = element("summary", explanation.sentence[0].toUpperCase() + explanation.sentence.slice(1));
  const numbers = explanation.numbers === 1 ? "1 number" : `${explanation.numbers} numbers`;
  details.append(summary, element("p", `It needs ${numbers}. Largest error without it: ${explanation.without}; with it: ${explanation.radius}.`));
  if (explanation.sizes.length) {
    const table = element("table", null);
    for (const [name, size] of explanation.sizes) {
      const row = element("tr", null);
      row.append(cell(name), cell(size, "number"));
      table.append(row);
    }
    const wide = element("div", null, { class: "wide" });
    wide.append(table);
    details.append(wide);
  }
  const frame = element("iframe", null, { title: explanation.sentence, sandbox: "allow-same-origin" });
  details.addEventListener("toggle", () => {
    if (details.open && !frame.hasAttribute("src")) frame.setAttribute("src", `page?explanation=${number}&answer=${answerNumber}&at=${state.answered}`);
  });
  const drawing = element("p", "The page is being drawn ...", { role: "status" });
  frame.addEventListener("load", () => { if (frame.hasAttribute("src")) drawing.hidden = true; });
  details.append(drawing, frame);
  item.append(details);
  return item;
}

// What a change changed in the answers about the same files.
function showBefore() {
  const bodies = [], every = beside().filter(one => one.before);
  for (const one of every) {
    // A diagnosis has the parameters of the calibration beside it.
    const changed = differences(one.before, one.answer, one.command !== "diagnose" || every.length < 2), body = element("tbody", null), head = element("tr", null);
    head.append(element("th", one.command, { colspan: 3, scope: "rowgroup" }));
    body.append(head, ...changed.map(([name, first, second]) => {
      const row = element("tr", null);
      row.append(cell(name), cell(first, "number"), cell(second, "number"));
      return row;
    }));
    if (changed.length) bodies.push(body);
  }
  $("before-part").hidden = !bodies.length;
  for (const body of [...$("before").tBodies]) body.remove();
  $("before").append(...bodies);
}

// Name, text before and text after of what differs in two answers, with their parameters or without.
function differences(before, after, withParameters) {
  const rows = [["verdict", before.verdict.split(":")[0], after.verdict.split(":")[0]]];
  after.sentences.forEach((text, k) => rows.push(["", before.sentences[k] || "", text]));
  const parts = answer => new Map([...Object.entries(answer.key), ...answer.explanations.flatMap(one => one.sizes),
    ...(withParameters ? answer.parameters : []).map(one => [`${one.symbol} ${one.name}${one.unit && one.unit !== "1" ? ` [${one.unit}]` : ""}`, one.text])]);
  const earlier = parts(before), later = parts(after);
  for (const name of new Set([...earlier.keys(), ...later.keys()])) rows.push([name, String(earlier.get(name) ?? "–"), String(later.get(name) ?? "–")]);
  return rows.filter(([, first, second]) => first !== second);
}

// The record

async function showRecord(file) {
  const about = file.about;
  $("import").hidden = true;
  $("record-warnings").replaceChildren();
  $("series").hidden = about ? about.table : true;
  $("table").hidden = !about || !about.table;
  const saved = Object.keys(file.decisions).length ? `Decisions are kept in ${file.decisions_file}.` : "";
  $("kept").textContent = saved;
  $("decided").hidden = !about;
  if (!about) {
    $("record-about").textContent = file.problem === READING ? `${file.name} ${file.problem} ...` : file.problem;
    const option = ASKS.exec(file.problem);
    const unknown = option && { questions: [{ key: option[1], answers: [], why: file.problem }], columns: [], header: [], rows: [] };
    $("import").hidden = !file.imported && !unknown;
    $("series").hidden = !file.preview || !$("import").hidden;
    if (!$("import").hidden) showImport(file, file.imported || unknown);
    else if (file.preview) { rests = []; marks = []; $("rests").tBodies[0].replaceChildren(); await draw(); }
    return;
  }
  $("record-about").textContent = `${file.name}: ${about.word} of ${about.rows} rows.`;
  $("record-warnings").replaceChildren(...about.warnings.map(text => element("p", `Warning: ${text}.`, { class: "warning" })));
  if (about.table) return showTable(file);
  $("turns").value = file.decisions.turns || "";
  if (!lines || lines.file !== current) await draw();
  await showRests();
}

// A file that is not a record: its questions, then its first rows as understood

function showImport(file, { questions, columns, header, rows, command }) {
  const tell = (given, write) => send({ do: "import", file: current, given, write });
  const damage = / row (?!1:)\d+/.test(file.problem) ? `${file.problem}. Mend the file and open it again, or import it. ` : "";
  $("record-about").textContent = damage + (questions.length ? `${file.name} is not a record yet. Answer ${questions.length === 1 ? "one question" : questions.length + " questions"}:` : `${file.name} becomes this record:`);
  const parts = questions.map(question => {
    const label = element("label", question.why[0].toUpperCase() + question.why.slice(1)), select = element("select", null, { "aria-label": question.key });
    const other = element("input", null, { "aria-label": `Other answer to ${question.key}`, placeholder: "another answer" });
    for (const word of ["", ...question.answers]) select.append(element("option", word));
    const answered = value => { if (value) tell({ ...file.given, [question.key]: value }, false); };
    select.addEventListener("change", () => answered(select.value));
    other.addEventListener("change", () => answered(other.value.trim()));
    const part = element("div", null, { class: "question" }), row = element("div", null, { class: "row" });
    label.append(" ", element("code", question.key));
    const only = question.answers.length === 1;
    if (question.answers.length === 0) row.append(other);
    else row.append(...only ? [button(question.answers[0], () => answered(question.answers[0]), `Answer ${question.answers[0]} to ${question.key}`)] : [select], other);
    part.append(label, row);
    return part;
  });
  if (questions.length && rows.length) parts.push(element("p", "The first rows, as the file has them:"), tableOf(header, rows));
  if (!questions.length) {
    const make = element("button", "Make the record", { type: "button", id: "make" });
    make.addEventListener("click", async () => {
      const result = await tell(file.given, true);
      if (result.file !== undefined) { current = result.file; chosen = new Set([current]); span = null; await look(); show(); }
    });
    parts.push(element("p", columns.join("; ")), tableOf(header, rows), make);
  }
  if (Object.keys(file.given).length) {
    const words = Object.entries(file.given).map(([key, value]) => `${key}=${value}`).join(", ");
    parts.push(element("p", `Answered: ${words}`), button("Answer again", () => tell({}, false)));
  }
  if (!questions.length) parts.push(element("p", "The same without this page:"), element("pre", command));
  renew($("import"), parts);
}

function tableOf(header, rows) {
  const table = element("table", null), head = element("tr", null), wide = element("div", null, { class: "wide" });
  head.append(...header.map(name => element("th", name, { class: "number" })));
  table.append(head, ...rows.map(cells => {
    const row = element("tr", null);
    row.append(...cells.map(text => cell(text, "number")));
    return row;
  }));
  wide.append(table);
  return wide;
}

function showTable(file) {
  const { header, rows } = file.about.table_rows, out = new Set(file.decisions.left_out || []);
  const wrong = new Set(wrongIn(current));
  const head = element("tr", null);
  head.append(element("th", "used"), ...header.map(name => element("th", name, { class: "number" })));
  $("positions").tHead.replaceChildren(head);
  renew($("positions").tBodies[0], rows.map(cells => {
    const number = Number(cells[0]);
    const row = element("tr", null, { class: out.has(number) ? "left-out" : wrong.has(number) ? "wrong" : "" });
    const tick = element("input", null, { type: "checkbox", "aria-label": `Use position ${number}` });
    tick.checked = !out.has(number);
    tick.addEventListener("change", () => {
      tick.checked ? out.delete(number) : out.add(number);
      decide({ left_out: [...out].sort((a, b) => a - b) });
    });
    row.append(cell(tick), ...cells.map(text => cell(text, "number")));
    return row;
  }));
  const first = $("positions").querySelector("tr.wrong"), scroll = $("table").firstElementChild;
  if (first) scroll.scrollTop = first.offsetTop - scroll.clientHeight / 2;
}

async function draw() {
  const query = new URLSearchParams({ file: current, points: Math.min(1600, Math.round($("panels").clientWidth || 900)) });
  if (span) { query.set("from", span[0]); query.set("to", span[1]); }
  const answer = await get(`lines?${query}`);
  if (answer.refusal) { $("refusal").textContent = answer.refusal; return; }
  lines = { ...answer, file: current };
  span = span || [lines.from_s, lines.to_s];
  $("span").textContent = `${Number(span[0].toPrecision(6))} to ${Number(span[1].toPrecision(6))} s`;
  drawPanels();
}

async function showRests() {
  const query = new URLSearchParams({ file: current, ...options() });
  const answer = await get(`rests?${query}`);
  rests = answer.rests || [];
  marks = answer.marks || [];
  $("rests-reason").textContent = answer.refusal || answer.reason || "";
  drawPanels();
}

// Of many rests only those of the shown stretch have rows.
function listRests() {
  const numbers = rests.map((_, number) => number);
  const shown = numbers.filter(number => rests[number].to_s >= span[0] && rests[number].from_s <= span[1]);
  renew($("rests").tBodies[0], shown.slice(0, MOST_ROWS).map(number => showRest(rests[number], number)));
  $("rests-count").textContent = shown.length > MOST_ROWS ? `${rests.length} rests; the first ${MOST_ROWS} are listed. Look closer for the others.` : `${rests.length} rests`;
}

// What the pictures mark: rests behind the lines, moves below them, limits above them.
const KINDS = { rest: ["rest", 0, HEIGHT - BELOW], refused: ["rest, not used", 0, HEIGHT - BELOW], move: ["move", HEIGHT - BELOW - 5, 5], limit: ["limit", 0, 6], spike: ["spike", 0, HEIGHT - BELOW], gap: ["gap", 0, HEIGHT - BELOW] };

function showKinds() {
  const counts = {};
  for (const rest of rests) counts[rest.refused ? "refused" : "rest"] = (counts[rest.refused ? "refused" : "rest"] || 0) + 1;
  for (const mark of marks) counts[mark.kind] = (counts[mark.kind] || 0) + 1;
  $("kinds").replaceChildren(...Object.keys(KINDS).filter(kind => counts[kind]).map(kind => {
    const [name, top, height] = KINDS[kind], part = element("span", null), svg = drawn("svg", { viewBox: "0 0 22 12", "aria-hidden": "true" });
    const thin = height < 20;
    svg.append(drawn("rect", { class: kind, x: 0, width: kind === "spike" ? 3 : 22, y: thin && top ? 8 : 0, height: thin ? 4 : 12 }));
    part.append(svg, `${name} (${counts[kind]})`);
    return part;
  }));
}

function used() {
  return rests.filter(rest => !rest.refused).map(rest => [rest.from_s, rest.to_s, rest.face]);
}

function changed(number, values) {
  const list = rests.map(rest => [rest.from_s, rest.to_s, rest.face]);
  list.splice(number, 1, ...values);
  const refused = new Set(rests.flatMap((rest, k) => rest.refused && k !== number ? [`${rest.from_s} ${rest.to_s}`] : []));
  decide({ rests: list.filter(([from, to]) => !refused.has(`${from} ${to}`)) });
}

function showRest(rest, number) {
  const row = element("tr", null, { class: rest.refused ? "left-out" : number === selected ? "chosen" : "" });
  const time = (name, change) => {
    const input = element("input", null, { type: "number", step: "any", "aria-label": `${name} of rest ${number + 1} [s]` });
    input.value = change(rest).toFixed(3);
    return input;
  };
  const from = time("Beginning", one => one.from_s), to = time("End", one => one.to_s);
  for (const input of [from, to]) input.addEventListener("change", () => changed(number, [[Number(from.value), Number(to.value), rest.face]]));
  const face = element("select", null, { "aria-label": `Face of rest ${number + 1}` });
  for (const word of FACES) face.append(element("option", word));
  face.value = rest.face;
  face.addEventListener("change", () => changed(number, [[rest.from_s, rest.to_s, face.value]]));
  const acts = element("span", null, { class: "row" });
  if (rest.refused) acts.append(element("span", rest.refused), button("Use it", () => {
    const list = used();
    list.push([rest.from_s, rest.to_s, rest.face]);
    decide({ rests: list });
  }, `Use rest ${number + 1}`));
  else {
    const middle = (rest.from_s + rest.to_s) / 2, next = rests[number + 1];
    acts.append(button("Leave out", () => changed(number, []), `Leave out rest ${number + 1}`));
    acts.append(button("Cut", () => changed(number, [[rest.from_s, middle, rest.face], [middle, rest.to_s, rest.face]]), `Cut rest ${number + 1}`));
    if (next && !next.refused) acts.append(button("Join with next", () => {
      const list = used().filter(one => one[0] !== rest.from_s && one[0] !== next.from_s);
      decide({ rests: [...list, [rest.from_s, next.to_s, rest.face]] });
    }, `Join rest ${number + 1} with the next`));
  }
  row.append(cell(String(number + 1), "number"), cell(from), cell(to), cell(face), cell(rest.norm.toFixed(5), "number"), cell((1000 * rest.scatter).toFixed(2), "number"), cell(acts));
  row.addEventListener("focusin", () => { selected = number; drawBands(); });
  return row;
}

// Pictures: a panel for each instrument, with the rests below the lines

const place = time => LEFT + (time - span[0]) / (span[1] - span[0]) * (WIDTH - LEFT);
const timeAt = x => span[0] + (x - LEFT) / (WIDTH - LEFT) * (span[1] - span[0]);

function drawn(name, attributes) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

function drawPanels() {
  if (!lines || lines.file !== current) return;
  WIDTH = Math.max(300, $("panels").clientWidth);
  $("panels").replaceChildren(...lines.panels.flatMap(panel => {
    const legend = element("p", null, { class: "legend" });
    legend.append(element("b", `${panel.title} [${panel.unit}]`), ...panel.lines.map((line, axis) => element("span", line.name, { class: `c${axis}` })));
    return [legend, panelOf(panel)];
  }));
  drawBands();
  listRests();
}

// Round numbers between two, about as many as asked.
function ticks(low, high, count) {
  const rough = (high - low) / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find(factor => factor * power >= rough), values = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) values.push(Number((k * step).toPrecision(12)));
  return values;
}

function panelOf(panel) {
  const svg = drawn("svg", { class: "panel", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img", "aria-label": `${panel.title} over time` });
  const values = panel.lines.flatMap(line => [...line.low, ...line.high]).filter(value => value !== null);
  let low = Infinity, high = -Infinity;
  for (const value of values) { if (value < low) low = value; if (value > high) high = value; }
  if (low === high) { low -= 1; high += 1; }
  const at = value => (HEIGHT - BELOW - 4) * (high - value) / (high - low) + 4;
  svg.append(drawn("g", { class: "bands" }));
  for (const value of ticks(low, high, 4)) {
    svg.append(drawn("line", { class: "grid", x1: LEFT, x2: WIDTH, y1: at(value), y2: at(value) }));
    const text = drawn("text", { x: LEFT - 4, y: at(value) + 4, "text-anchor": "end" });
    text.textContent = value;
    svg.append(text);
  }
  for (const time of ticks(span[0], span[1], WIDTH / 120)) {
    const text = drawn("text", { x: Math.min(place(time), WIDTH - 16), y: HEIGHT - 4, "text-anchor": "middle" });
    text.textContent = time;
    svg.append(text);
  }
  panel.lines.forEach((line, axis) => {
    const points = [];
    lines.time.forEach((time, k) => {
      if (line.low[k] === null) { points.push(null); return; }
      const x = place(time).toFixed(1);
      points.push(`${x} ${at(line.low[k]).toFixed(1)}`);
      if (line.high[k] !== line.low[k]) points.push(`${x} ${at(line.high[k]).toFixed(1)}`);
    });
    let path = "", begun = false;
    for (const point of points) {
      if (point === null) { begun = false; continue; }
      path += `${begun ? "L" : "M"}${point}`;
      begun = true;
    }
    svg.append(drawn("path", { class: `c${axis}`, d: path }));
  });
  svg.append(drawn("g", { class: "edges" }));
  svg.addEventListener("pointerdown", event => begin(event, svg));
  svg.addEventListener("dblclick", () => { span = null; draw(); });
  return svg;
}

function drawBands() {
  for (const svg of document.querySelectorAll(".panel")) {
    const bands = svg.querySelector(".bands"), edges = svg.querySelector(".edges");
    bands.replaceChildren();
    edges.replaceChildren();
    const band = (from, to, kind, look, what) => {
      const [, y, height] = KINDS[kind], x = Math.max(LEFT, place(from)), end = Math.min(WIDTH, place(to));
      if (end < x) return;
      const rect = drawn("rect", { class: `${kind} ${look}`, x, y, width: Math.max(end - x, 1), height }), title = drawn("title", {});
      title.textContent = what;
      rect.append(title);
      bands.append(rect);
    };
    rests.forEach((rest, number) => {
      band(rest.from_s, rest.to_s, rest.refused ? "refused" : "rest", number === selected ? "chosen" : "", `rest ${number + 1} ${rest.refused}`);
      if (rest.refused) return;
      for (const [side, time] of [[0, rest.from_s], [1, rest.to_s]]) {
        const x = place(time);
        if (x >= LEFT && x <= WIDTH) edges.append(drawn("line", { class: "edge", x1: x, x2: x, y1: 0, y2: HEIGHT - BELOW, "data-rest": number, "data-side": side }));
      }
    });
    for (const mark of marks) band(mark.from_s, mark.to_s, mark.kind, "", mark.what);
  }
  showKinds();
}

function begin(event, svg) {
  if (event.button !== 0) return;
  const at = one => {
    const x = new DOMPoint(one.clientX, one.clientY).matrixTransform(svg.getScreenCTM().inverse()).x;
    return Math.min(span[1], Math.max(span[0], timeAt(x)));
  };
  const edge = event.target.closest(".edge"), start = at(event);
  const stretch = drawn("rect", { class: "drawn", y: 0, height: HEIGHT - BELOW, x: place(start), width: 0 });
  svg.append(stretch);
  svg.setPointerCapture(event.pointerId);
  event.preventDefault();
  let now = start;
  const move = one => {
    now = at(one);
    stretch.setAttribute("x", Math.min(place(start), place(now)));
    stretch.setAttribute("width", Math.abs(place(now) - place(start)));
  };
  const end = () => {
    svg.removeEventListener("pointermove", move);
    stretch.remove();
    const [from, to] = [Math.min(start, now), Math.max(start, now)];
    if (edge) {
      const number = Number(edge.dataset.rest), rest = rests[number];
      const kept = rests.filter(one => !one.refused), place = kept.indexOf(rest);
      const least = place > 0 ? kept[place - 1].to_s : -Infinity, most = place + 1 < kept.length ? kept[place + 1].from_s : Infinity;
      const ends = edge.dataset.side === "0" ? [Math.max(now, least), rest.to_s] : [rest.from_s, Math.min(now, most)];
      if (ends[0] < ends[1] && now !== start) changed(number, [[...ends, rest.face]]);
    } else if (to - from > 0.005 * (span[1] - span[0])) {
      if ($("mark").checked) { $("mark").checked = false; decide({ rests: [...used(), [from, to, ""]] }); }
      else { span = [from, to]; draw(); }
    } else {
      const number = rests.findIndex(rest => rest.from_s <= start && start <= rest.to_s);
      if (number >= 0) { selected = number; drawBands(); const input = document.querySelector(`#rests input[aria-label^="Beginning of rest ${number + 1} "]`); if (input) input.focus(); }
    }
  };
  svg.addEventListener("pointermove", move);
  svg.addEventListener("pointerup", end, { once: true });
}

function zoom(how) {
  if (!lines) return;
  const width = span[1] - span[0], whole = lines.to_s - lines.from_s;
  let [from, to] = span;
  if (how === "all") [from, to] = [lines.from_s, lines.to_s];
  else if (how === "in") [from, to] = [from + width / 4, to - width / 4];
  else if (how === "out") [from, to] = [from - width / 2, to + width / 2];
  else { const step = (how === "left" ? -0.5 : 0.5) * width; [from, to] = [from + step, to + step]; }
  const size = Math.min(to - from, whole);
  from = Math.min(Math.max(from, lines.from_s), lines.to_s - size);
  span = [from, from + size];
  draw();
}

// A measurement at the table, above the records

async function lookAtTable() {
  try {
    const answer = await fetch("now", { cache: "no-store", signal: AbortSignal.timeout(4000) });
    if (!answer.ok) throw new Error(answer.status);
    showMoment(await answer.text());
    connection(true);
  } catch (error) { connection(false); }
  setTimeout(lookAtTable, 500);
}

function showMoment(text) {
  const fresh = [...new DOMParser().parseFromString(text, "text/html").body.children], old = [...$("now").children];
  if (fresh.length !== old.length || fresh.some((part, k) => part.id !== old[k].id)) $("now").replaceChildren(...fresh);
  else fresh.forEach((part, k) => { if (part.outerHTML !== old[k].outerHTML) old[k].replaceWith(part); });
  ended = $("now").querySelector("[data-ended]") !== null;
  $("end").disabled = ended;
  document.title = $("next") ? $("next").textContent : "At the table";
}

async function tellTable(word) {
  try {
    const answer = await fetch("word", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(word) });
    if (!answer.ok) throw new Error(answer.status);
  } catch (error) { connection(false); }
}

if ($("now")) {
  $("now").addEventListener("click", event => {
    const one = event.target.closest("button[data-word]");
    if (!one) return;
    one.disabled = true;
    tellTable(JSON.parse(one.dataset.word));
  });
  $("end").addEventListener("click", () => { if (confirm("End the measurement? It can be taken up again with --resume.")) tellTable({ word: "end" }); });
  lookAtTable();
}

// Words of the person

async function drop(files) {
  for (const file of files) {
    $("refusal").textContent = "";
    const answer = await fetch(`drop?${encodeURIComponent(file.name)}`, { method: "POST", body: file });
    const result = answer.ok ? await answer.json() : { refusal: `${file.name}: cannot be taken` };
    if (result.refusal) $("refusal").textContent = result.refusal;
    else { current = result.file; if (chosen.size < 2) chosen = new Set([current]); span = null; }
  }
  await look();
  show();
}

for (const one of document.querySelectorAll("#commands button")) one.addEventListener("click", () => run(one.dataset.command));
for (const one of document.querySelectorAll("[data-zoom]")) one.addEventListener("click", () => zoom(one.dataset.zoom));
for (const one of document.querySelectorAll("[data-copy]")) one.addEventListener("click", () => navigator.clipboard.writeText($(one.dataset.copy).textContent));
async function save(what) {
  const result = await send({ do: "save", what, answer: answerNumber });
  if (result.file) $("note").textContent = `Written: ${result.file}`;
}
for (const one of document.querySelectorAll("[data-save]")) one.addEventListener("click", () => save(one.dataset.save));
$("export").addEventListener("click", () => save($("target").value));
$("page-details").addEventListener("toggle", showPage);
$("page").addEventListener("load", () => { $("drawing").hidden = true; });
$("undo").addEventListener("click", () => send({ do: "undo", file: current }));
$("running").lastElementChild.addEventListener("click", () => send({ do: state.running ? "stop" : "again" }));
$("add-rest").addEventListener("click", () => {
  const [from, to] = [$("new-from"), $("new-to")].map(input => Number(input.value));
  if (from < to) decide({ rests: [...used(), [from, to, ""]] });
  else refuse("A rest needs two times, the later one last.");
});
$("set-turns").addEventListener("click", () => decide({ turns: $("turns").value.trim() }));
$("choose").addEventListener("change", event => drop(event.target.files));
document.querySelector("#options [name=rest_scatter]").addEventListener("change", () => showRests());
$("drop").addEventListener("dragover", event => { event.preventDefault(); $("drop").classList.add("over"); });
$("drop").addEventListener("dragleave", () => $("drop").classList.remove("over"));
$("drop").addEventListener("drop", event => { event.preventDefault(); $("drop").classList.remove("over"); drop(event.dataTransfer.files); });
window.addEventListener("resize", () => { if (lines && !$("series").hidden) draw(); });
poll();
