// Parameters, and their changes.
// A number as it is typed, with a point or a comma; NaN if it is none.
const typed = (text) => /^\s*[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?\s*$/i.test(text) ? Number(text.replace(',', '.')) : NaN;
const brief = (value) => String(+value.toPrecision(7));
const same = (a, b) => Math.fround(a) === Math.fround(b);
const of = (full) => state.parameters.find((it) => it.full === full);

// Rows stay where they are, so that one may type while values change. `targets` has the names of all that a row changes.
function rowsOf(table, list, name, targets, steps) {
  const rows = new Map([...table.rows].map((row) => [row.dataset.parameter, row]));
  for (const it of list) {
    let row = rows.get(it.full);
    if (!row) {
      row = table.insertRow(); row.dataset.parameter = it.full;
      cell(row, name(it));
      const place = cell(row, ''), input = place.appendChild(document.createElement('input'));
      input.setAttribute('aria-label', it.full); input.inputMode = 'decimal'; input.autocomplete = 'off';
      const said = document.createElement('small'); said.setAttribute('role', 'status'); said.hidden = true;
      const go = (text) => change(it.full, text, input, said, targets(it));
      input.onkeydown = (event) => {
        if (event.key === 'Enter') { event.preventDefault(); input.dataset.left = '1'; go(input.value); }
        if (event.key === 'Escape') { input.value = input.dataset.value; input.blur(); }
      };
      input.oninput = () => { delete input.dataset.left; clearTimeout(input.later); input.later = setTimeout(() => foresee(it.full, input, said), 150); };
      input.onchange = () => { if (!input.dataset.left) go(input.value); delete input.dataset.left; };
      if (steps) for (const [factor, text] of [[0.8, '×0.8'], [1.25, '×1.25']]) {
        const button = document.createElement('button'); button.textContent = text; button.setAttribute('aria-label', it.full + ' ' + text);
        button.onclick = () => {
          const { value, range } = of(it.full);
          // From nothing there is no way by factors.
          const next = value ? value * factor : factor > 1 ? range[1] / 100 : 0;
          go(next < range[1] ? String(+next.toPrecision(3)) : brief(range[1]));
        };
        factor < 1 ? input.before(button) : input.after(button);
      }
      place.append(said);
      cell(row, it.unit, 'unit');
    }
    rows.delete(it.full);
    row.className = same(it.value, it.initial) ? '' : 'changed';
    row.cells[2].textContent = (it.unit + ' ' + brief(it.range[0]) + ' … ' + brief(it.range[1])).trim();
    row.title = brief(it.range[0]) + ' to ' + brief(it.range[1]) + ', ' + brief(it.initial) + ' in the table';
    row.cells[2].title = row.className ? brief(it.initial) + ' in the table' : '';
    const input = row.querySelector('input'), said = row.querySelector('small'), now = brief(it.value);
    // What was said of the value before, unless it was said of this one.
    if (input.dataset.value !== now && said.dataset.of !== now) { tellAt(said, ''); delete said.dataset.meant; }
    input.dataset.value = now;
    if (document.activeElement !== input) input.value = input.dataset.value;
  }
  for (const row of rows.values()) row.remove();
}

function parameters() {
  const wanted = $('find').value.toLowerCase();
  rowsOf($('parameters'), state.parameters, (it) => it.label + (it.name === 'value' ? '' : ' ' + it.name), (it) => [it.full]);
  for (const row of $('parameters').rows) row.hidden = !row.dataset.parameter.toLowerCase().includes(wanted);
  recall();
}

// A value as the robot gets it: its limits are typed with fewer digits than they have.
const meant = (it, text) => { const wanted = typed(text), limit = it.range.find((limit) => Math.abs(wanted - limit) <= 1e-6 * Math.abs(limit)); return limit === undefined ? wanted : limit; };
// What is known of a value before it is sent: [its words, whether they are a warning].
async function advice(it, text) {
  const wanted = meant(it, text), [least, most] = it.range;
  if (Number.isNaN(wanted)) return ['“' + text + '” is no number', true];
  if (wanted < least || wanted > most) return [text + ' is out of its range: ' + brief(least) + ' to ' + brief(most), true];
  const found = await post({ advise: [it.full, wanted] }).catch(() => null);
  if (!found) return ['', false];
  const margin = (value) => value === null || value > 99 ? '> 99' : value.toFixed(1);
  const words = it.name.replace(/^.*_/, '') + ' ' + brief(wanted) + ': margin of the ' + found.loop + ' loop ' + margin(found.margin) + ', now ' + margin(found.now) + (found.phase === null ? '' : '; phase margin ' + found.phase.toFixed(0) + '°');
  if (found.margin === null || found.margin >= found.least) return [words, false];
  return [words + (found.margin < 1 ? ', will oscillate' : ', may oscillate') + (found.ask === null ? '' : '; ask for ' + brief(found.ask)), true];
}
function tellAt(said, words, isBad) { said.textContent = words; said.hidden = !words; said.className = isBad ? 'bad' : 'hint'; }
async function foresee(full, input, said) {
  const text = input.value, it = of(full);
  if (!it || text.trim() === '' || text === input.dataset.value) return tellAt(said, '');
  const known = await advice(it, text);
  if (input.value === text) tellAt(said, ...known);
}

// Changes a parameter, of all `targets` alike, and says at its box why not.
async function change(full, text, input, said, targets) {
  clearTimeout(input.later);
  const it = of(full), back = () => { if (document.activeElement !== input) input.value = input.dataset.value; };
  if (!it) return;
  const [words, isBad] = await advice(it, text), wanted = meant(it, text), isMeant = said.dataset.meant === text;
  // A loop that would shake is said so before it does; the same value once more is meant.
  if (isBad && !isMeant) {
    const isSendable = wanted >= it.range[0] && wanted <= it.range[1];
    tellAt(said, words + (isSendable ? '. Enter it once more to set it all the same.' : ''), true);
    if (isSendable) said.dataset.meant = text; else delete said.dataset.meant;
    return back();
  }
  delete said.dataset.meant;
  try { await send(targets.map((full) => [full, wanted])); said.dataset.of = brief(Math.fround(wanted)); tellAt(said, isBad ? words : '', isBad); } catch (error) { tellAt(said, String(error.message || error), true); back(); }
}
// Sends changes, all or none, and remembers how to undo them.
async function send(changes) {
  if (!changes.length) return;
  const step = changes.map(([full, wanted]) => [full, of(full).value, wanted]);
  await post({ set: changes });
  undo.push(step); undoAt = state.now; keepUndo();
}

// The changes of this page, with those before a reload: of this robot since it was switched on.
const robot = () => state.declaration + '/' + state.boot;
let undoOf = null;
let undoAt = 0;          // the robot's time of the last change
function keepUndo() {
  undo = undo.slice(-100);
  try { localStorage.setItem('rc10-undo', JSON.stringify({ robot: undoOf, undo })); } catch { /* private window */ }
  for (const it of document.querySelectorAll('.undo')) it.disabled = !undo.length;
}
function recall() {
  if (!state.whole || undoOf === robot()) return;
  undoOf = robot(); undo = [];
  try { const kept = JSON.parse(localStorage.getItem('rc10-undo')); if (kept && kept.robot === undoOf) undo = kept.undo; } catch { /* nothing is kept */ }
  keepUndo();
}
async function undoLast() {
  const step = undo.pop(); keepUndo();
  if (!step) return;
  undoAt = state.now;
  const foreign = step.find(([full, , after]) => !of(full) || !same(of(full).value, after));
  if (foreign) return say('refused', foreign[0] + ' was changed elsewhere since, and stays as it is');
  await attempt({ set: step.map(([full, before]) => [full, before]) }).catch(() => { undo.push(step); keepUndo(); });
}
for (const it of document.querySelectorAll('.undo')) it.onclick = undoLast;
