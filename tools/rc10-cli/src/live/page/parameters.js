// Parameters, and their changes.
// Rows stay where they are, so that one may type while values change.
function parameters() {
  const table = $('parameters'), wanted = $('find').value.toLowerCase();
  const rows = new Map([...table.rows].map((row) => [row.dataset.parameter, row]));
  for (const it of state.parameters) {
    let row = rows.get(it.full);
    if (!row) {
      row = table.insertRow(); row.dataset.parameter = it.full;
      cell(row, it.label + (it.name === 'value' ? '' : ' ' + it.name));
      const input = cell(row, '').appendChild(document.createElement('input'));
      input.setAttribute('aria-label', it.full);
      input.onkeydown = (event) => { if (event.key === 'Enter') input.blur(); if (event.key === 'Escape') { input.value = input.dataset.value; input.blur(); } };
      input.onchange = () => change(it.full, input);
      cell(row, it.unit, 'unit');
    }
    rows.delete(it.full);
    row.hidden = !it.full.toLowerCase().includes(wanted);
    row.className = it.value !== it.initial ? 'changed' : '';
    row.title = it.range[0] + ' to ' + it.range[1] + ', ' + it.initial + ' at power-on';
    const input = row.cells[1].firstChild;
    input.dataset.value = String(+it.value.toPrecision(7));
    if (document.activeElement !== input) input.value = input.dataset.value;
  }
  for (const row of rows.values()) row.remove();
}

async function change(full, input) {
  const it = state.parameters.find((it) => it.full === full), wanted = Number(input.value);
  if (!it || input.value.trim() === '' || Number.isNaN(wanted)) { say('refused', '“' + input.value + '” is no number'); input.value = input.dataset.value; return; }
  // A loop that would shake is said so before it does; the same value once more is meant.
  const advice = input.dataset.meant === input.value ? null : await post({ advise: [full, wanted] }).catch(() => null);
  if (advice) { say('refused', full + ' = ' + input.value + ': ' + advice + '. Enter it once more to set it all the same.'); input.dataset.meant = input.value; input.value = input.dataset.value; return; }
  delete input.dataset.meant;
  try {
    await attempt({ set: [[full, wanted]] });
    undo.push([it.full, it.value]); $('undo').disabled = false;
  } catch { input.value = input.dataset.value; }
}
$('undo').onclick = async () => {
  const last = undo.pop(); $('undo').disabled = !undo.length;
  const it = last && state.parameters.find((it) => it.full === last[0]);
  if (it) await attempt({ set: [[it.full, last[1]]] }).catch(() => {});
};
