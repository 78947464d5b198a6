// The page in a browser alone: in place of a server a worker, with the robot that the address names.
window.inBrowser = true;
const Web = (() => {
  // The choice: `#robot=omni&board=dm-mc02&fault=cut:2@1s..2s&mistake=..&lesson=plug`; the board `sim` is the simulator.
  const choice = new URLSearchParams(location.hash.slice(1));
  const robot = () => ROBOTS[choice.get('robot')] ? choice.get('robot') : 'starter', board = () => choice.get('board') || ROBOTS[robot()][0];
  const compile = async () => { try { return await WebAssembly.compileStreaming(serve('rc10.wasm')); } catch { return WebAssembly.compile(await (await serve('rc10.wasm')).arrayBuffer()); } };
  const serve = window.fetch.bind(window), module = compile(), waiting = new Map();
  let worker = null, last = 0, own = null, over = null;

  const send = (what, it, to = worker) => new Promise((done, fail) => {
    last += 1;
    waiting.set(last, { done, fail });
    to.postMessage([what, { id: last, ...it }]);
  });
  // What the page asks its server for.
  window.fetch = async (target, { method, body } = {}) => {
    if (over) throw new Error(over);
    const answer = await send('ask', { isPost: method === 'POST', target: '/' + target, body: body || '' });
    return new Response(answer.body, { status: answer.status, headers: { 'Content-Type': answer.kind } });
  };
  function heard({ data }) {
    if (data.ended) { ended(data.ended); return; }
    const it = waiting.get(data.id);
    waiting.delete(data.id);
    if (it) it.done(data);
  }
  function ended({ anew, error }) {
    if (anew) { choice.delete('mistake'); for (const it of anew) choice.append('mistake', it); begin(); return; }
    over = error;
    for (const { fail } of waiting.values()) fail(new Error(error));
    waiting.clear();
    tell(error);
  }
  async function begin() {
    if (worker) worker.terminate();
    for (const { fail } of waiting.values()) fail(new Error('begins anew'));
    waiting.clear();
    over = null;
    worker = new Worker('worker.js', { type: 'module' });
    worker.onmessage = heard;
    worker.onerror = (event) => ended({ error: event.message || 'the worker does not run here' });
    const asked = choice.get('robot');
    if (asked && !ROBOTS[asked]) { shown(); ended({ error: 'there is no robot ' + asked + ' here' }); return; }
    history.replaceState(null, '', '#' + choice);
    const words = ['live', '--out', '/records', '--seed', choice.get('seed') || '1'], isChip = board() !== 'sim';
    const file = own ? own.name.replace(/[^\w.-]/g, '_') : robot() + '-' + board() + '.elf';
    words.push(...(isChip ? ['--emu', '/' + file] : ['--sim']));
    for (const kind of ['fault', 'mistake']) for (const it of choice.getAll(kind)) words.push('--' + kind + '=' + it);
    if (choice.has('script')) words.push('--script');
    try {
      const elf = isChip ? own ? own.bytes : await program(robot(), board()) : null;
      worker.postMessage(['begin', { module: await module, robot: robot(), words, given: elf ? { [file]: elf } : {} }]);
    } catch (error) { ended({ error: String(error.message || error) }); }
    tell(own && isChip ? own.name + ', with the motors of ' + robot() : '');
    shown();
  }
  async function program(name, on) {
    const answer = await serve('robots/' + name + '-' + on + '.elf');
    if (!answer.ok) throw new Error('there is no program of ' + name + ' for ' + on + ' here');
    return new Uint8Array(await answer.arrayBuffer());
  }
  // A command to its end, beside the robot that runs: what it printed.
  async function command(words, given = {}) {
    const other = new Worker('worker.js', { type: 'module' });
    other.onmessage = heard;
    const answer = await send('command', { module: await module, robot: robot(), words, given }, other);
    other.terminate();
    return answer;
  }

  // ---- the bar -------------------------------------------------------------------------------
  const add = (place, tag, text) => { const it = place.appendChild(document.createElement(tag)); if (text) it.textContent = text; return it; };
  const bar = document.createElement('div'), told = document.createElement('span');
  bar.className = 'bar'; bar.id = 'web';
  document.querySelector('header').after(bar);
  const select = (label, act) => { const it = add(add(bar, 'label', label + ' '), 'select'); it.onchange = () => act(it.value); return it; };
  const change = (name, value) => { if (value) choice.set(name, value); else choice.delete(name); begin(); };
  const robots = select('Robot', (it) => { own = null; for (const name of ['board', 'fault', 'mistake', 'lesson']) choice.delete(name); change('robot', it); });
  const boards = select('on', (it) => change('board', it));
  const lessons = select('Lesson', (it) => { choice.set('robot', it === 'swap' ? 'omni' : robot()); for (const name of ['fault', 'mistake']) choice.delete(name); change('lesson', it); });
  const pick = add(bar, 'input'), open = add(bar, 'button', 'Your ELF …'), save = add(bar, 'button', 'Save the record');
  Object.assign(pick, { type: 'file', hidden: true });
  pick.setAttribute('aria-label', 'A program for the chip');
  open.title = 'A firmware for the STM32H723, of this robot or made by rc10 new: choose it, or drop it on the page';
  open.onclick = () => pick.click();
  pick.onchange = () => { if (pick.files[0]) take(pick.files[0]); pick.value = ''; };
  save.onclick = async () => {
    const { file } = await send('newest', { ending: '.mcap' });
    if (!file) return;
    const it = document.createElement('a');
    it.href = URL.createObjectURL(new Blob([file.body])); it.download = file.name; it.click();
    setTimeout(() => URL.revokeObjectURL(it.href), 1000);
  };
  told.setAttribute('role', 'status'); bar.append(told);
  const tell = (text) => { told.textContent = text || ''; };
  async function take(file) {
    own = { name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) };
    if (board() === 'sim') choice.delete('board');
    begin();
  }
  for (const kind of ['dragover', 'drop']) window.addEventListener(kind, (event) => {
    event.preventDefault();
    if (kind === 'drop' && event.dataTransfer.files[0]) take(event.dataTransfer.files[0]);
  });
  $('report').onclick = async (event) => {
    event.preventDefault();
    window.open(URL.createObjectURL(await (await fetch('report')).blob()), '_blank');
  };
  function shown() {
    const fill = (it, all, value) => { it.replaceChildren(...all.map(([key, text]) => new Option(text, key, false, key === value))); };
    fill(robots, ['starter', ...Object.keys(ROBOTS).filter((it) => it !== 'starter')].map((it) => [it, it]), robot());
    fill(boards, [...ROBOTS[robot()].map((it) => [it, 'emulated ' + it]), ['sim', 'simulator']], board());
    fill(lessons, [['', 'none'], ...LESSONS.map(([key, title]) => [key, title])], choice.get('lesson') || '');
    Lesson.begin(choice.get('lesson'));
  }

  // ---- lessons -------------------------------------------------------------------------------
  const armed = () => named('', 'arm') === 'Armed', broken = (start) => (state.broken || []).some((it) => it.startsWith(start));
  const turns = () => state.signals.some((it) => it.folder === 'motors' && it.name === 'speed' && Math.abs(it.value) > 10);
  const hot = () => state.parameters.some((it) => it.name.endsWith('kp') && it.value > 4 * it.initial);
  const ARM = ['Arm, as the line under the remote says.', armed], DRIVE = ['Hold W: the wheels turn.', () => armed() && turns()];
  const LESSONS = [
    ['drive', 'Drive', [ARM, DRIVE]],
    ['plug', 'Pull a plug', [ARM, DRIVE, ['Let something go wrong: unplug a motor, while W is held.', () => broken('cut:')], ['Read under Problems what the robot says of it.', () => (state.problems || []).length > 0],
      ['Take it back.', () => !broken('cut:')], ['Hold W: the motor comes back gently.', () => armed() && turns()]]],
    ['tune', 'Tune a wheel', [ARM, ['Under Motors, open a wheel and set its speed_kp to five times of what it is.', hot], ['Hold W, and look at the plot: it swings. Read under Problems what that is.', () => (state.problems || []).length > 0], ['Undo.', () => !hot()]]],
    ['swap', 'Two motors are swapped: which?', [ARM, ['Drive, watch wheels and field, and answer below.', () => Lesson.found]]],
  ];
  const Lesson = (() => {
    let steps = null, at = 0, list = null, pair = null;
    const it = { found: false, begin: (key) => {
      const lesson = LESSONS.find(([name]) => name === key);
      if (list) list.remove();
      [steps, at, list, pair, it.found] = [lesson ? lesson[2] : null, 0, null, null, false];
      $('broken').style.display = key === 'swap' ? 'none' : '';
      if (!lesson) return;
      list = document.createElement('section'); list.className = 'lesson';
      bar.after(list);
      add(list, 'b', lesson[1]);
      const all = add(list, 'ol');
      for (const [text] of steps) add(all, 'li', text);
      look('robot');
    } };
    // Two wheels by chance, so that a class has several.
    function hide() {
      const wheels = labels('motors').slice(0, 4), first = Math.floor(Math.random() * wheels.length), other = (first + 1 + Math.floor(Math.random() * (wheels.length - 1))) % wheels.length;
      pair = [wheels[first], wheels[other]];
      post({ break: 'swap:' + pair.map((label) => label.replaceAll(' ', '-')).join(',') }).catch(() => { pair = null; });
      const line = add(list, 'p'), both = [0, 1].map(() => add(line, 'select')), go = add(line, 'button', 'These two'), said = add(line, 'span');
      both.forEach((box, place) => { box.setAttribute('aria-label', place ? 'The other one' : 'Which one'); box.replaceChildren(...wheels.map((label) => new Option(label, label))); });
      go.onclick = () => { it.found = both.every((box) => pair.includes(box.value)) && both[0].value !== both[1].value; said.textContent = it.found ? 'Yes.' : 'No: look again.'; };
    }
    setInterval(() => {
      if (!steps || !state.whole || at >= steps.length) return;
      if (choice.get('lesson') === 'swap' && !pair && armed()) hide();
      if (!steps[at][1]()) return;
      list.querySelectorAll('li')[at].className = 'done';
      at += 1;
      if (at === steps.length) add(list, 'p', 'Done.').setAttribute('role', 'status');
    }, 100);
    return it;
  })();
  setInterval(() => { save.hidden = !/^record: /.test(state.note || '') && !state.report; }, 500);
  // The remote is at hand at once: here no other page can hold it.
  const hold = setInterval(() => {
    if (!moving.remote) return;
    clearInterval(hold);
    if (moving.remote.holder === 'table') Drive.take();
  }, 20);
  // What a visitor wants to see first.
  try { if (!localStorage.getItem('rc10-view')) localStorage.setItem('rc10-view', 'robot'); } catch { /* private window */ }
  window.addEventListener('hashchange', () => location.reload());
  return { begin, command, program };
})();
Web.begin();
