// The page in a browser alone: in place of a server a worker, with the robot that the address names.
window.inBrowser = true;
const Web = (() => {
  // The choice: `#robot=omni&board=dm-mc02&fault=cut:2@1s..2s&mistake=..&lesson=plug`; the board `sim` is the simulator.
  const choice = new URLSearchParams(location.hash.slice(1));
  const robot = () => ROBOTS[choice.get('robot')] ? choice.get('robot') : 'starter', board = () => choice.get('board') || ROBOTS[robot()][0];
  const compile = async () => { try { return await WebAssembly.compileStreaming(serve('rc10.wasm')); } catch { return WebAssembly.compile(await (await serve('rc10.wasm')).arrayBuffer()); } };
  const serve = window.fetch.bind(window), module = compile(), waiting = new Map();
  let worker = null, last = 0, own = null, over = null;

  const send = (what, it) => new Promise((done, fail) => {
    last += 1;
    waiting.set(last, { done, fail });
    worker.postMessage([what, { id: last, ...it }]);
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
    // Nothing of a robot before.
    [over, state, moving] = [null, { signals: [], parameters: [], losses: {} }, {}];
    const its = worker = new Worker('worker.js', { type: 'module' }), asked = choice.get('robot'), isChip = board() !== 'sim';
    worker.onmessage = heard;
    worker.onerror = (event) => ended({ error: event.message || 'the worker does not run here' });
    // Behind what the page's own script defines.
    setTimeout(shown);
    if (asked && !ROBOTS[asked]) { ended({ error: 'there is no robot ' + asked + ' here' }); return; }
    history.replaceState(null, '', '#' + choice);
    const words = ['live', '--out', '/records', '--seed', choice.get('seed') || '1'];
    const file = own ? own.name.replace(/[^\w.-]/g, '_') : robot() + '-' + board() + '.elf';
    words.push(...(isChip ? ['--emu', '/' + file] : ['--sim']));
    for (const kind of ['fault', 'mistake']) for (const it of choice.getAll(kind)) words.push('--' + kind + '=' + it);
    if (choice.has('script')) words.push('--script');
    words.push(...Lesson.words());
    try {
      const elf = isChip ? own ? own.bytes : await program(robot(), board()) : null, compiled = await module;
      if (worker !== its) return;
      worker.postMessage(['begin', { module: compiled, robot: robot(), words, given: elf ? { [file]: elf } : {} }]);
    } catch (error) { if (worker === its) ended({ error: String(error.message || error) }); return; }
    tell(own && isChip ? own.name + ', with the motors of ' + robot() : '');
    hold();
  }
  async function program(name, on) {
    const answer = await serve('robots/' + name + '-' + on + '.elf');
    if (!answer.ok) throw new Error('there is no program of ' + name + ' for ' + on + ' here');
    return new Uint8Array(await answer.arrayBuffer());
  }
  // A command to its end, beside the robot that runs: what it printed.
  async function command(words, given = {}) {
    const other = new Worker('worker.js', { type: 'module' });
    try {
      const answer = new Promise((done, fail) => { other.onmessage = ({ data }) => data.ended ? fail(new Error(data.ended.error)) : done(data); });
      other.postMessage(['command', { module: await module, robot: robot(), words, given }]);
      return await answer;
    } finally { other.terminate(); }
  }

  // ---- the bar -------------------------------------------------------------------------------
  const add = (place, tag, text) => { const it = place.appendChild(document.createElement(tag)); if (text) it.textContent = text; return it; };
  const bar = document.createElement('div'), told = document.createElement('span');
  bar.className = 'bar'; bar.id = 'web';
  document.querySelector('header').after(bar);
  const select = (label, act) => { const it = add(add(bar, 'label', label + ' '), 'select'); it.onchange = () => act(it.value); return it; };
  // The page anew: nothing of what was there is left.
  const change = (name, value) => {
    if (value) choice.set(name, value); else choice.delete(name);
    history.replaceState(null, '', '#' + choice);
    location.reload();
  };
  const robots = select('Robot', (it) => { for (const name of ['board', 'fault', 'mistake', 'lesson']) choice.delete(name); change('robot', it); });
  const boards = select('on', (it) => change('board', it));
  const lessons = select('Lesson', (it) => { choice.set('robot', it === 'swap' ? 'omni' : robot()); for (const name of ['fault', 'mistake']) choice.delete(name); change('lesson', it); });
  const pick = add(bar, 'input'), open = add(bar, 'button', 'Your ELF …'), saves = add(bar, 'button', 'Save the record');
  Object.assign(pick, { type: 'file', hidden: true });
  pick.setAttribute('aria-label', 'A program for the chip');
  open.title = 'A firmware for the STM32H723, of this robot or made by rc10 new: choose it, or drop it on the page';
  open.onclick = () => pick.click();
  pick.onchange = () => { if (pick.files[0]) take(pick.files[0]); pick.value = ''; };
  saves.onclick = async () => {
    const { file } = await send('newest', { ending: '.mcap' });
    if (file) save(file.name, new Blob([file.body]));
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
    const tab = window.open('', '_blank');
    tab.location = URL.createObjectURL(await (await fetch('report')).blob());
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
  const WHEELS = ['front left', 'front right', 'rear left', 'rear right'].map((it) => 'wheel ' + it);
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
      [steps, at, list, it.found] = [lesson ? lesson[2] : null, 0, null, false];
      // They name the two.
      for (const id of ['broken', 'problems', 'log']) $(id).style.display = key === 'swap' ? 'none' : '';
      if (!lesson) return;
      list = document.createElement('section'); list.className = 'lesson';
      bar.after(list);
      add(list, 'b', lesson[1]);
      const all = add(list, 'ol');
      for (const [text] of steps) add(all, 'li', text);
      if (key === 'swap') ask();
      look('robot');
    }, words: () => {
      if (choice.get('lesson') !== 'swap' || robot() !== 'omni') return [];
      // Two by chance, so that a class has several.
      const first = Math.floor(Math.random() * 4), other = (first + 1 + Math.floor(Math.random() * 3)) % 4;
      pair = [WHEELS[first], WHEELS[other]];
      return ['--mistake=swap:' + pair.map((label) => label.replaceAll(' ', '-')).join(',')];
    } };
    function ask() {
      const line = add(list, 'p'), both = [0, 1].map(() => add(line, 'select')), go = add(line, 'button', 'These two'), said = add(line, 'span');
      both.forEach((box, place) => { box.setAttribute('aria-label', place ? 'The other one' : 'Which one'); box.replaceChildren(...WHEELS.map((label) => new Option(label, label))); });
      go.onclick = () => { it.found = both.every((box) => pair.includes(box.value)) && both[0].value !== both[1].value; said.textContent = it.found ? 'Yes.' : 'No: look again.'; };
    }
    setInterval(() => {
      if (!steps || !state.whole || at >= steps.length || !steps[at][1]()) return;
      list.querySelectorAll('li')[at].className = 'done';
      at += 1;
      if (at === steps.length) add(list, 'p', 'Done.').setAttribute('role', 'status');
    }, 100);
    return it;
  })();
  setInterval(() => { saves.hidden = state.record || !/^record: /.test(state.note || '') && !state.report; }, 500);
  // The remote is at hand at once: here no other page can hold it.
  function hold() {
    const it = setInterval(() => {
      if (!moving.remote) return;
      clearInterval(it);
      if (moving.remote.holder === 'table') Drive.take();
    }, 20);
  }
  // What a visitor wants to see first.
  try { if (!localStorage.getItem('rc10-view')) localStorage.setItem('rc10-view', 'robot'); } catch { /* private window */ }
  window.addEventListener('hashchange', () => location.reload());
  return { begin, command, program };
})();
Web.begin();
