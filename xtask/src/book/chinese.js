// mdBook in Chinese.
if (document.documentElement.lang === 'zh-CN') {
  const WORDS = {
    'Keyboard shortcuts': '快捷键',
    'Press ← or → to navigate between chapters': '← →：上一章、下一章',
    'Press S or / to search in the book': 'S 或 /：搜索',
    'Press ? to show this help': '?：显示本帮助',
    'Press Esc to hide this help': 'Esc：关闭本帮助',
    'Table of contents': '目录',
    'Toggle Table of Contents': '显示或隐藏目录',
    'Change theme': '切换主题',
    Themes: '主题',
    Auto: '跟随系统',
    Light: '浅色',
    'Search (`/`)': '搜索（/）',
    'Toggle Searchbar': '显示或隐藏搜索栏',
    'Search this book ...': '搜索……',
    'Page navigation': '翻页',
    'Previous chapter': '上一章',
    'Next chapter': '下一章',
  };
  addEventListener('DOMContentLoaded', () => {
    for (const it of document.querySelectorAll('#mdbook-help-popup > h2, #mdbook-help-popup p, .theme')) {
      it.textContent = WORDS[it.textContent] ?? it.textContent;
    }
    for (const name of ['title', 'aria-label', 'placeholder']) {
      for (const it of document.querySelectorAll(`[${name}]`)) {
        const words = it.getAttribute(name);
        it.setAttribute(name, WORDS[words] ?? words);
      }
    }
  });

  // Its search cuts a text into words at its spaces, and Chinese has none. Here a part of a page is found when all that
  // was typed stands somewhere in it.
  const count = (text, word) => text.toLowerCase().split(word).length - 1;
  const load = ({ documentStore }) => ({
    search(typed) {
      const words = typed.toLowerCase().split(/\s+/);
      const found = [];
      for (const [ref, { title, breadcrumbs, body }] of Object.entries(documentStore.docs)) {
        const counts = words.map((word) => 10 * count(title, word) + count(body, word));
        if (counts.includes(0)) continue;
        const begin = Math.max(0, body.toLowerCase().indexOf(words[0]) - 20);
        let teaser = body.slice(begin, begin + 100);
        // mdBook marks what stands between spaces.
        for (const word of words) teaser = teaser.replaceAll(word, ` ${word} `);
        found.push({ ref, score: counts.reduce((a, b) => a + b), doc: { breadcrumbs, body: teaser } });
      }
      queueMicrotask(() => {
        document.getElementById('mdbook-searchresults-header').textContent = `“${typed}”：${found.length} 处`;
      });
      return found.sort((a, b) => b.score - a.score);
    },
  });
  // Before the first search, which can be in the page's address.
  let its = null;
  const set = (it) => (its = Object.assign(it, { Index: Object.assign(it.Index, { load }) }));
  Object.defineProperty(window, 'elasticlunr', { get: () => its, set });
}
