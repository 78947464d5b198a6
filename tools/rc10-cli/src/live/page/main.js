// The page: asks for the state, and shows it.
async function refresh() {
  try {
    state = await (await fetch('/state')).json() || state;
    $('trouble').textContent = state.trouble || '';
    document.body.classList.remove('ended');
  } catch { $('trouble').textContent = 'rc10 live has ended'; document.body.classList.add('ended'); setTimeout(refresh, 1000); return; }
  $('name').textContent = state.name;
  say('note', state.note);
  const arm = named('', 'arm');
  $('arm').textContent = arm; $('arm').className = 'pill ' + arm;
  const stick = named('', 'not_at_rest');
  say('rest', stick === '–' || stick === 'all' ? '' : 'Not armed: ' + stick + ' is not at rest. Put it there and arm again.');
  show();
  $('record').textContent = state.record ? '■ ' + state.record.seconds.toFixed(0) + ' s' : '● Record';
  $('record').className = state.record ? 'on' : '';
  const losses = [['samples', 'samples lost on the way'], ['skipped', 'samples the line was too slow for'], ['damaged', 'damaged frames'], ['unknown', 'messages not understood'], ['left', 'signals without room']];
  $('losses').textContent = losses.filter(([name]) => state.losses[name] > 0).map(([name, what]) => state.losses[name] + ' ' + what).join(' · ');
  if (state.whole && (!begun || state.declaration !== declaration)) begin();
  tables(); parameters();
  setTimeout(refresh, 200);
}

for (const seconds of [1, 2, 5, 10, 30, 60, 120]) $('window').add(new Option(seconds + ' s', seconds, seconds === 10, seconds === 10));
for (const period of [1, 2, 5, 10]) $('period').add(new Option(period + ' ms', period, period === 10, period === 10));
$('window').onchange = () => { span = +$('window').value; keep(); };
$('period').onchange = watch;
$('search').oninput = tree; $('find').oninput = parameters;
$('record').onclick = () => attempt({ record: !state.record }).catch(() => {});
refresh(); fetchData();
