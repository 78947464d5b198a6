// One motor's panel: its gains beside its plot, for motors alike too, steps of it, and lines for the table.
let tuned = null;        // label of the motor whose panel is open
let borrowed = [];       // signals that the panel has put into the plots
const gainsOf = (label) => state.parameters.filter((it) => it.label === label && it.name !== 'value');

function openTune(label) {
  const before = tuned;
  closeTune();
  if (label === before) return;
  tuned = label;
  borrowed = state.signals.filter((it) => it.folder === 'motors' && it.label === label && ['target', 'measured', 'current', 'drive'].includes(it.name) && !chosen.has(it.index)).map((it) => it.index);
  borrowed.forEach((it) => chosen.add(it));
  $('tuned').textContent = label; $('alike').checked = false; $('copied').hidden = true; say('step-said', '');
  tree(); watch(); tables(); tune();
}
function closeTune() {
  if (tuned === null) return;
  borrowed.forEach((it) => chosen.delete(it));
  tuned = null; borrowed = []; $('gains').replaceChildren(); $('tune').hidden = true;
  tree(); watch();
}
$('untune').onclick = closeTune;

// Motors whose labels differ by their place alone, and that have the same gains in the table.
const PLACES = /\b(front|rear|back|left|right|top|bottom|upper|lower|inner|outer|fl|fr|rl|rr|\d+)\b|[左右前后上下]/gi;
function alikes(label) {
  const kind = (label) => label.replace(PLACES, '').replace(/[\s_-]+/g, ' ').trim();
  const table = (label) => JSON.stringify(gainsOf(label).map((it) => [it.name, it.initial, it.range]));
  const own = table(label);
  return labels('motors').filter((it) => it === label || (kind(label) && kind(it) === kind(label) && table(it) === own));
}
const sibling = (it, label) => gainsOf(label).find((other) => other.name === it.name).full;
const targets = (it) => $('alike').checked ? alikes(tuned).map((label) => sibling(it, label)) : [it.full];

function tune() {
  if (tuned === null) return;
  if (!labels('motors').includes(tuned)) return closeTune();
  $('tune').hidden = false;
  const all = alikes(tuned), others = all.filter((it) => it !== tuned);
  rowsOf($('gains'), gainsOf(tuned), (it) => it.name, targets, true);
  $('alike-label').hidden = !others.length;
  $('alike-label').title = all.join(', ');
  $('alike-label').lastElementChild.textContent = 'All ' + all.length + ' alike';
  $('same').hidden = !differences().length;
  $('same').textContent = 'Make the other ' + others.length + ' the same';
}
const differences = () => alikes(tuned).flatMap((label) => gainsOf(tuned).map((it) => [sibling(it, label), it.value])).filter(([full, value]) => !same(of(full).value, value));
$('same').onclick = () => send(differences()).then(() => say('refused', ''), (error) => say('refused', String(error.message || error)));

$('copy').onclick = async () => {
  const text = await attempt({ table: true }).catch(() => null);
  if (text === null) return;
  $('copied').textContent = text || '// nothing is changed';
  $('copied').hidden = false;
  // A browser may forbid it: then it is there to be copied by hand.
  navigator.clipboard.writeText(text).catch(() => {});
  getSelection().selectAllChildren($('copied'));
};

// ---- steps ----------------------------------------------------------------------------------------------------------
const Step = (() => {
  const CONSTANT = 0.1, LEAST = 0.25, MOST = 2, BAND = 0.05;
  // Figures of what follows a jump `from` one value `to` another, at `times` s after it: rise time from 10 to 90 % of its own
  // way, overshoot in % of that, time after which it stays within 5 % of where it ends; and what is left to the target.
  function figures(times, values, from, to) {
    const end = times[times.length - 1], tail = [];
    for (let i = 0; i < times.length; i += 1) if (times[i] >= 0.8 * end) tail.push(values[i]);
    const last = tail.reduce((sum, it) => sum + it, 0) / tail.length, way = last - from;
    const share = (i) => (values[i] - from) / way;
    const reaches = (level) => {
      for (let i = 1; i < times.length; i += 1) if (share(i) >= level && share(i - 1) < level) return times[i - 1] + (level - share(i - 1)) / (share(i) - share(i - 1)) * (times[i] - times[i - 1]);
      return NaN;
    };
    let peak = 0, settling = 0;
    for (let i = 0; i < times.length; i += 1) {
      peak = Math.max(peak, share(i));
      if (Math.abs(share(i) - 1) > BAND) settling = i + 1 < times.length ? times[i + 1] : NaN;
    }
    // What leaves the band near the end may leave it again.
    if (settling > 0.9 * end) settling = NaN;
    return { rise: reaches(0.9) - reaches(0.1), overshoot: Math.max(0, peak - 1) * 100, settling, error: to - last };
  }
  // Steps in a target that stands still before and after them, while the motor runs: when each began, and what followed it.
  function find(target, measured, runs) {
    const { times } = target, asked = target.values.map((it, i) => runs(times[i]) ? it : NaN);
    const known = asked.filter(Number.isFinite), size = Math.max(...known) - Math.min(...known, ...(asked.some(Number.isNaN) ? [0] : [])), steps = [];
    for (let i = 1; i < asked.length; i += 1) {
      const to = asked[i], before = asked[i - 1];
      if (!Number.isFinite(to) || before === to) continue;
      let last = i, first = i - 1;
      while (last + 1 < asked.length && asked[last + 1] === to && times[last + 1] - times[i] <= MOST) last += 1;
      while (first > 0 && Object.is(asked[first - 1], before) && times[i] - times[first] < CONSTANT) first -= 1;
      const at = times[i];
      if (times[last] - at < LEAST || times[i - 1] - times[first] < 0.5 * CONSTANT) continue;
      const within = (low, high) => [...measured.times.keys()].filter((k) => measured.times[k] >= low && measured.times[k] <= high && Number.isFinite(measured.values[k]));
      const rest = within(at - CONSTANT, at - 1e-4), after = within(at, times[last]);
      if (!rest.length || after.length < 20) continue;
      const from = rest.reduce((sum, k) => sum + measured.values[k], 0) / rest.length;
      // What still moves, as after a turn that was interrupted, is not at rest.
      const calm = Math.max(...rest.map((k) => Math.abs(measured.values[k] - from))) <= 0.1 * Math.abs(to - from);
      if (!calm || !(size > 0) || Math.abs(to - from) < 0.2 * size) continue;
      const seconds = after.map((k) => measured.times[k] - at), values = after.map((k) => measured.values[k]);
      steps.push({ at, from, to, times: seconds, values, ...figures(seconds, values, from, to) });
    }
    return steps;
  }
  return { figures, find };
})();

let overlay = [];        // the last five, the newest last
// Those that matter to a step of a speed, or of an angle.
const gainsText = (label, unit) => gainsOf(label).filter((it) => it.value > 0 && (unit === 'deg' || !it.name.startsWith('angle'))).map((it) => it.name + ' ' + brief(it.value)).join(', ');

// What the robot told of some signals in a time, as dense as it is: signal -> { times, values }, s from `begin`, µs.
async function fetchSeries(signals, begin, to) {
  const answer = await fetch('data?signals=' + signals.join(',') + '&from=' + begin + '&to=' + to + '&columns=10000');
  if (!answer.ok) throw new Error('no data');
  return series(signals, new DataView(await answer.arrayBuffer()));
}
async function collect(label, begin, to) {
  const index = (name) => (state.signals.find((it) => it.folder === 'motors' && it.label === label && it.name === name) || {}).index;
  const all = ['target', 'measured', 'drive'].map(index);
  if (all.includes(undefined)) return 0;
  const found = await fetchSeries(all, begin, to), [target, measured, drive] = all.map((it) => found.get(it));
  const run = state.signals.find((it) => it.index === all[2]).states.indexOf('Run');
  const unit = named(label, 'target_kind').startsWith('Speed') ? 'rpm' : 'deg', gains = gainsText(label, unit);
  const news = Step.find(target, measured, (seconds) => at(drive, seconds) === run).map((it) => ({ ...it, at: it.at + begin * 1e-6, label, gains, unit }));
  const fresh = news.filter((it) => !overlay.some((old) => old.label === label && Math.abs(old.at - it.at) < 0.05));
  overlay = overlay.concat(fresh).slice(-5);
  drawSteps();
  return news.length;
}

$('steps-found').onclick = async () => {
  const label = tuned;
  // Not from before these gains: what they were then is not known here.
  const begin = Math.max(0, undoAt, Math.round(state.now - 60e6));
  const count = await collect(label, begin, state.now).catch(() => 0);
  say('step-said', count ? '' : 'No step in the last minute with these gains: its target moved slowly, or the motor was not driven.');
};

let testing = null;
// Waits in the robot's time: a simulated one may be slower than the clock.
async function passes(millis, goes) {
  const begin = state.now;
  while (goes() && state.now >= begin && state.now < begin + 1000 * millis) await new Promise((go) => setTimeout(go, 20));
}
async function stepTest() {
  const label = tuned, speed = typed($('step-speed').value), period = $('period').value, mine = testing = {}, goes = () => testing === mine && !mine.isOver;
  if (Number.isNaN(speed) || speed === 0) return say('step-said', 'The speed of a step is a number other than 0');
  say('step-said', 'It turns for a second while the button is held …');
  // As dense as the line can.
  $('period').value = '1'; await watch();
  await passes(300, goes);
  const begin = state.now;
  if (goes()) {
    const turning = jog(label, speed);
    passes(1300, goes).then(() => { if (goes()) jog(label, 0); });
    const refused = await turning;
    if (refused) { say('step-said', refused); mine.isOver = true; }
  } else mine.isOver = true;
  if (!mine.isOver) await passes(600, () => true);
  $('period').value = period; watch();
  if (testing === mine) testing = null;
  if (mine.isOver) return;
  const count = await collect(label, Math.max(0, Math.round(begin - 200e3)), state.now).catch(() => 0);
  say('step-said', count ? 'Turned by hand: with a fifth of its limit, and a target that starts at its acceleration.' : 'Too short: hold the button for a second.');
}
holdable($('step'), stepTest, () => { if (testing && !testing.isLet) { testing.isLet = true; testing = null; jog(tuned, 0); } });

function drawSteps() {
  const rows = $('figures');
  $('steps').hidden = !overlay.length; rows.replaceChildren();
  if (!overlay.length) return;
  const head = rows.insertRow();
  for (const text of ['step', 'gains', 'rise', 'overshoot', 'settling', 'steady error']) { const th = document.createElement('th'); th.textContent = text; head.append(th); }
  const ms = (seconds) => Number.isNaN(seconds) ? '–' : (seconds * 1000).toFixed(0) + ' ms';
  overlay.forEach((it, place) => {
    const row = rows.insertRow(), first = cell(row, it.label + ' ' + brief(+it.from.toFixed(1)) + ' → ' + brief(+it.to.toFixed(1)) + ' ' + it.unit), sign = document.createElement('i');
    sign.style.background = Plot.colour(place); first.prepend(sign);
    cell(row, it.gains, 'gains'); cell(row, ms(it.rise)); cell(row, it.overshoot.toFixed(0) + ' %'); cell(row, Number.isNaN(it.settling) ? 'not settled' : ms(it.settling)); cell(row, it.error.toPrecision(2) + ' ' + it.unit);
  });
  const { pen, width, height } = Plot.open($('steps')), box = { left: 40, top: 8, right: width - 8, bottom: height - 20 };
  const longest = Math.max(...overlay.map((it) => it.times[it.times.length - 1])), share = (it, k) => (it.values[k] - it.from) / (it.to - it.from);
  const highest = Math.min(3, Math.max(1.2, ...overlay.flatMap((it) => it.values.map((_, k) => share(it, k) * 1.05))));
  const x = Plot.across(box, [0, longest]), y = Plot.up(box, [-0.1, highest]);
  Plot.valueAxis(pen, box, [-0.1, highest], '');
  Plot.timeAxis(pen, box, [0, longest], false);
  Plot.stroke(pen, [[box.left, y(1)], [box.right, y(1)]], Plot.style('muted'));
  Plot.inside(pen, box, () => overlay.forEach((it, place) => Plot.trace(pen, [0, it.times.length - 1], (k) => [x(it.times[k]), y(share(it, k))], { paint: Plot.colour(place), width: 1.5 })));
}
