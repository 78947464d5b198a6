// What goes wrong on purpose, by the words of --fault and --mistake: only with a simulated robot.
const Broken = (() => {
  const word = (label) => label.replaceAll(' ', '-');
  const buses = () => labels('buses').map((bus) => [bus, 'bus ' + bus]), motors = () => labels('motors').map((label) => [word(label), label]);
  const KINDS = [['cut:', 'unplug a motor', motors], ['power:', 'a motor without power', motors], ['cut:', 'unplug a bus', buses], ['short:', 'short a bus', buses],
    ['power:', 'a bus without power', buses], ['load:', 'fill a bus', buses], ['swap:', 'swap two motors', motors, motors], ['load:', 'a load twice as heavy', motors, null, '=x2'], ['remote-lost', 'lose the remote'],
    ['direction:', 'a motor mounted the other way: begins anew', motors], ['radius:x2', 'wheels twice as large: begins anew']];
  let parts = null;
  function build() {
    const place = $('broken'), add = (to, tag, text) => { const it = to.appendChild(document.createElement(tag)); if (text) it.textContent = text; return it; };
    const details = add(place, 'details');
    add(details, 'summary', 'Let something go wrong');
    const line = add(details, 'p'), kind = add(line, 'select'), which = [0, 1].map(() => add(line, 'select')), words = add(line, 'input'), go = add(line, 'button', 'Break it');
    line.className = 'hands';
    kind.setAttribute('aria-label', 'What goes wrong'); which.forEach((it, at) => it.setAttribute('aria-label', at ? 'The other one' : 'Which one'));
    words.setAttribute('aria-label', 'In words, as --fault and --mistake take them');
    KINDS.forEach(([, text], at) => kind.add(new Option(text, at)));
    const write = () => { const [start, , , , end] = KINDS[kind.value]; words.value = start + which.filter((it) => !it.hidden).map((it) => it.value).join(',') + (end || ''); };
    kind.onchange = () => {
      which.forEach((it, at) => { const all = KINDS[kind.value][2 + at]; it.hidden = !all; it.replaceChildren(...(all ? all() : []).map(([value, text]) => new Option(text, value))); });
      if (!which[1].hidden) which[1].selectedIndex = 1;
      write();
    };
    which.forEach((it) => { it.onchange = write; });
    words.onkeydown = (event) => { if (event.key === 'Enter') go.click(); };
    go.onclick = () => attempt({ break: words.value.trim() }).catch(() => {});
    parts = { list: add(place, 'ul'), shown: '', kind };
    parts.list.setAttribute('aria-label', 'What was let go wrong');
    kind.onchange();
  }
  function show() {
    $('broken').hidden = !state.is_simulated;
    if (!state.is_simulated || !state.whole) return;
    if (!parts) build();
    const shown = JSON.stringify(state.broken);
    if (shown === parts.shown) return;
    parts.shown = shown;
    parts.list.replaceChildren(...state.broken.map((words) => {
      const it = document.createElement('li'), text = document.createElement('span'), back = document.createElement('button');
      text.textContent = words + ' '; text.className = 'bad'; back.textContent = 'Take back'; back.setAttribute('aria-label', 'Take back ' + words);
      back.onclick = () => attempt({ mend: words }).catch(() => {});
      it.append(text, back);
      return it;
    }));
  }
  return { show };
})();
