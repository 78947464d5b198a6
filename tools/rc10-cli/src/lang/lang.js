// Texts in the language of the reader: what is put on the page is looked up in the table, letters on canvases by `tr`.
const Lang = (() => {
  "use strict";
  const [TABLE, ASKED] = /*TABLE*/;
  const asked = new URLSearchParams(location.search).get("lang") || ASKED || navigator.language;
  const isChinese = asked.startsWith("zh");
  const whole = new Map(TABLE), known = new Map();
  const escaped = (text) => text.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");
  const patterns = TABLE.filter(([english]) => english.includes("{0}")).map(([english, chinese]) => {
    const pieces = english.split(/\{(\d)\}/), places = pieces.filter((_, at) => at % 2);
    const literal = pieces.filter((_, at) => at % 2 === 0);
    return { chinese, places, weight: literal.join("").length, form: new RegExp("^" + literal.map(escaped).join("(.+?)") + "$") };
  }).sort((a, b) => b.weight - a.weight);

  function search(text) {
    const found = whole.get(text);
    if (found !== undefined) return found;
    for (const { form, places, chinese } of patterns) {
      const values = form.exec(text);
      if (values) return chinese.replace(/\{(\d)\}/g, (_, place) => tr(values[places.indexOf(place) + 1]));
    }
    return text;
  }
  // The text in the reader's language, as far as the table has it: names stay.
  function tr(line) {
    if (!isChinese || !/[A-Za-z]/.test(line)) return line;
    const text = line.trim();
    let found = known.get(text);
    if (found === undefined) {
      // Numbers change for ever.
      if (known.size > 5000) known.clear();
      known.set(text, found = search(text));
    }
    return found === text ? line : line.replace(text, () => found);
  }

  const ATTRIBUTES = ["title", "aria-label", "placeholder"];
  function node(it) {
    if (it.nodeType === Node.TEXT_NODE) {
      const inside = it.parentNode && it.parentNode.tagName;
      const now = inside === "SCRIPT" || inside === "STYLE" ? it.data : tr(it.data);
      if (now !== it.data) it.data = now;
    } else if (it.nodeType === Node.ELEMENT_NODE) {
      for (const name of ATTRIBUTES) attribute(it, name);
      it.childNodes.forEach(node);
    }
  }
  function attribute(it, name) {
    const before = it.getAttribute(name), now = before === null ? null : tr(before);
    if (now !== before) it.setAttribute(name, now);
  }
  // From now on; before anything is painted.
  function watch() {
    if (!isChinese) return;
    document.documentElement.lang = "zh-CN";
    node(document.documentElement);
    new MutationObserver((changes) => {
      for (const change of changes) {
        if (change.type === "attributes") attribute(change.target, change.attributeName);
        else if (change.type === "characterData") node(change.target);
        else change.addedNodes.forEach(node);
      }
    }).observe(document.documentElement, { subtree: true, childList: true, characterData: true, attributes: true, attributeFilter: ATTRIBUTES });
  }
  return { isChinese, tr, watch };
})();
Lang.watch();
