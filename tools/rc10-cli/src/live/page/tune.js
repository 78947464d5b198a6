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
  tree(); watch(); tables(); tune(); lookTuned();
}
function closeTune() {
  if (tuned === null) return;
  clearTimeout(looks);
  borrowed.forEach((it) => chosen.delete(it));
  tuned = null; borrowed = []; $('gains').replaceChildren(); $('tune').hidden = true;
  tree(); watch();
}
$('untune').onclick = closeTune;

// What rc10 tune has found of the motor, in a shell; looked for again while the panel is open.
let looks = 0;
async function lookTuned() {
  const label = tuned, its = state.signals.find((it) => it.folder === 'motors' && it.label === label);
  const answer = its && await fetch('tuned?' + its.index).catch(() => null), page = answer && answer.ok ? await answer.text() : '';
  if (tuned !== label) return;
  $('found').hidden = !page;
  if (page) {
    const data = JSON.parse(new DOMParser().parseFromString(page, 'text/html').getElementById('data').textContent);
    Bode.draw($('bode'), $('bode-names'), data.curves);
    $('found-text').textContent = data.text.split('\n').map((line) => Lang.tr(line)).join('\n') + data.code;
  }
  clearTimeout(looks);
  looks = setTimeout(lookTuned, 3000);
}

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
function letGo(label, it) { it.until = state.now; jog(label, 0); }
// Whether a motor that turned by hand stood before the button was let go: the words to it came too late.
async function stood(label, begin, to) {
  const { index, states } = state.signals.find((it) => it.folder === 'motors' && it.label === label && it.name === 'drive'), run = states.indexOf('Run');
  const { values } = (await fetchSeries([index], begin, to)).get(index), first = values.indexOf(run);
  return first >= 0 && values.subarray(first).some((it) => it !== run);
}
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
    passes(1300, goes).then(() => { if (goes()) letGo(label, mine); });
    const refused = await turning;
    if (refused) { say('step-said', refused); mine.isOver = true; }
  } else mine.isOver = true;
  if (!mine.isOver) await passes(600, () => true);
  $('period').value = period; watch();
  if (testing === mine) testing = null;
  if (mine.isOver) return;
  const count = await collect(label, Math.max(0, Math.round(begin - 200e3)), state.now).catch(() => 0);
  const isLate = !count && await stood(label, begin, mine.until).catch(() => false);
  say('step-said', count ? 'Turned by hand: with a fifth of its limit, and a target that starts at its acceleration.'
    : isLate ? 'Interrupted: this PC was too late. Close what keeps it busy, and try again.' : 'Too short: hold the button for a second.');
}
holdable($('step'), stepTest, () => { if (testing && !testing.until) { letGo(tuned, testing); testing = null; } });

const drawSteps = () => Step.draw($('steps'), $('figures'), overlay);
