// Lists what is cut on the page, and what lies on something else; see boxes.py.
() => {
  const visible = (e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true });
  const name = (e) => {
    const own = e.className && typeof e.className === 'string' ? `.${e.className.split(' ').join('.')}` : '';
    const text = (e.textContent || e.getAttribute('aria-label') || '').trim().slice(0, 40);
    return `${e.localName}${own} "${text}"`;
  };
  const unseen = (e) => e.closest('.unseen, [hidden], .skip');
  // Every run of text, by its ink's box; every control; every picture.
  const leaves = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const e = node.parentElement;
    if (!node.data.trim() || !visible(e) || unseen(e) || e.closest('noscript, script, option')) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const box of range.getClientRects()) {
      if (box.width > 1 && box.height > 1) leaves.push({ e, box, isText: true });
    }
  }
  for (const e of document.querySelectorAll('button, a.button, input, select, img, canvas, svg:not(.icon)')) {
    if (!visible(e) || unseen(e) || e.classList.contains('camera')) continue;
    leaves.push({ e, box: e.getBoundingClientRect(), isText: false });
  }
  const found = [];
  const scrolls = (style) => /auto|scroll/.test(style.overflowY);
  for (const { e, box, isText } of leaves) {
    let canScroll = false;
    let floats = false;
    for (let up = e; up; up = up.parentElement) {
      const style = getComputedStyle(up);
      floats ||= style.position === 'fixed';
      if (up !== e && scrolls(style) && up.scrollHeight > up.clientHeight) canScroll = true;
      if (!isText && up === e) continue;
      if (style.overflowX === 'visible' && style.overflowY === 'visible') continue;
      if (up === document.body || up === document.documentElement) continue;
      const clip = up.getBoundingClientRect();
      if (box.left < clip.left - 2 || box.right > clip.right + 2) found.push(`cut at the side: ${name(e)}`);
      if (!scrolls(style) && (box.top < clip.top - 3 || box.bottom > clip.bottom + 3)) {
        found.push(`cut above or below: ${name(e)}`);
      }
      if (isText && style.textOverflow === 'ellipsis' && up.scrollWidth > up.clientWidth + 1) found.push(`shortened: ${name(e)}`);
    }
    if (box.left < -2 || box.right > innerWidth + 2) found.push(`outside of the window: ${name(e)}`);
    if (!canScroll && (box.top < -2 || box.bottom > innerHeight + 2)) found.push(`below the window: ${name(e)}`);
  }
  const layer = (e) => e.closest('#menu, #panel, toast-bar, .toasts, .detail, undo-screen .wide, .sticky, header') ?? document.body;
  for (let i = 0; i < leaves.length; i += 1) {
    const a = leaves[i];
    for (let j = i + 1; j < leaves.length; j += 1) {
      const b = leaves[j];
      if (a.e === b.e || a.e.contains(b.e) || b.e.contains(a.e)) continue;
      if (layer(a.e) !== layer(b.e)) continue;
      const across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
      const along = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
      if (across > 2 && along > 3) found.push(`overlap: ${name(a.e)} and ${name(b.e)}`);
    }
  }
  const stops = [...document.querySelectorAll('button.stop')].filter(visible).map((e) => e.getBoundingClientRect());
  if (!stops.some((box) => box.top >= 0 && box.left >= 0 && box.bottom <= innerHeight && box.right <= innerWidth)) {
    found.push('STOP is not on the screen');
  }
  if (document.documentElement.scrollWidth > innerWidth) found.push('the page is too wide');
  return [...new Set(found)];
}
