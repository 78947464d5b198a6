// Parameters that are kept over a power-off, and the button that saves them.
function kept() {
  const all = state.kept, button = $('save');
  const unsaved = all ? state.parameters.filter((it) => it.value !== (it.kept ?? it.initial)).map((it) => it.full) : [];
  button.hidden = !all;
  button.disabled = !unsaved.length || button.dataset.saves === '1';
  const text = unsaved.length ? 'Save (' + unsaved.length + ' unsaved)' : 'Saved';
  if (button.textContent !== text) button.textContent = text;
  button.title = unsaved.join(', ') || 'All that differs from the table is kept over a power-off';
  const unused = (all || []).filter((it) => it.known && !it.used).map((it) => it.name + ' = ' + number(it.value));
  const note = unused.length ? 'Kept, but not used, for unit or range has changed: ' + unused.join(', ') : '';
  if ($('kept').textContent !== note) say('kept', note);
}
$('save').onclick = async () => {
  $('save').dataset.saves = '1'; $('save').disabled = true;
  await attempt({ do: 'save' }).catch(() => {});
  $('save').dataset.saves = '0';
};
