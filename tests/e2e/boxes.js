// Lists the truncated and overlapping elements of the page; see boxes.py. A test runs this hundreds of
// times, so each element is measured once, and is compared only with its neighbours.
() => {
  const once = (ask) => {
    const known = new Map();
    return (e) => {
      if (!known.has(e)) known.set(e, ask(e));
      return known.get(e);
    };
  };
  const visible = once((e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true }));
  const name = (e) => {
    const own = e.className && typeof e.className === 'string' ? `.${e.className.split(' ').join('.')}` : '';
    const text = (e.textContent || e.getAttribute('aria-label') || '').trim().slice(0, 40);
    return `${e.localName}${own} "${text}"`;
  };
  const unseen = once((e) => e.closest('.unseen, [hidden], .skip') !== null || isClipped(e));
  const isClipped = (e) => Boolean(e) && (getComputedStyle(e).clipPath === 'inset(50%)' || isClipped(e.parentElement));
  const said = once((e) => e.closest('noscript, script, option') === null);
  // The box of every run of text, every control and every picture.
  const leaves = [];
  const found = [];
  const isBroken = (node) => !window.isMadeUp && [...node.data.matchAll(/[a-z\u00c0-\u024f]+/gi)].some(({ 0: word, index }) => {
    const range = document.createRange();
    range.setStart(node, index);
    range.setEnd(node, index + word.length);
    return new Set([...range.getClientRects()].map((box) => Math.round(box.top))).size > 1;
  });
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const e = node.parentElement;
    if (!node.data.trim() || !visible(e) || unseen(e) || !said(e)) continue;
    const range = document.createRange();
    if (e.closest('.move') && isBroken(node)) found.push(`broken within a word: ${name(e)}`);
    range.selectNodeContents(node);
    for (const box of range.getClientRects()) {
      if (box.width > 1 && box.height > 1) leaves.push({ e, box, isText: true });
    }
  }
  // A caption of the invented language may overlap the map.
  const placed = window.isMadeUp ? '' : ', drive-map, .vote';
  for (const e of document.querySelectorAll(`button, a.button, input, select, img, canvas, svg:not(.icon)${placed}`)) {
    if (!visible(e) || unseen(e) || e.matches('canvas.camera, canvas.seen')) continue; // other elements may overlap them
    leaves.push({ e, box: e.getBoundingClientRect(), isText: false });
  }
  const isRoot = (e) => e === document.body || e === document.documentElement;
  const boundsOf = once((e) => {
    const style = getComputedStyle(e);
    const scrolls = /auto|scroll/.test(style.overflowY);
    return {
      scrolls,
      isFixed: style.position === 'fixed',
      canScroll: scrolls && e.scrollHeight > e.clientHeight,
      clip: isRoot(e) || (style.overflowX === 'visible' && style.overflowY === 'visible') ? null : e.getBoundingClientRect(),
      shortens: style.textOverflow === 'ellipsis' && e.scrollWidth > e.clientWidth + 1,
    };
  });
  for (const leaf of leaves) {
    const { e, isText } = leaf;
    let { box } = leaf;
    let canScroll = false;
    let fixed = false;
    for (let up = e; up && !fixed; up = up.parentElement) {
      const bounds = boundsOf(up);
      fixed = bounds.isFixed; // an ancestor cannot clip a fixed element
      if (bounds.canScroll && (isText || up !== e)) {
        // Only the visible part of a scrolled element can be truncated or covered.
        canScroll = true;
        const [top, bottom] = [Math.max(box.top, bounds.clip.top), Math.min(box.bottom, bounds.clip.bottom)];
        box = leaf.box = { left: box.left, right: box.right, width: box.width, top, bottom: Math.max(top, bottom), height: Math.max(0, bottom - top) };
        if (bottom - top < 3) break;
      }
      if ((!isText && up === e) || bounds.clip === null) continue;
      const { clip } = bounds;
      if (box.left < clip.left - 2 || box.right > clip.right + 2) found.push(`cut at the side: ${name(e)}`);
      if (!bounds.scrolls && (box.top < clip.top - 3 || box.bottom > clip.bottom + 3)) {
        found.push(`cut above or below: ${name(e)}`);
      }
      if (isText && bounds.shortens) found.push(`shortened: ${name(e)}`);
    }
    if (box.left < -2 || box.right > innerWidth + 2) found.push(`outside of the window: ${name(e)}`);
    if (!canScroll && (box.top < -2 || box.bottom > innerHeight + 2)) found.push(`below the window: ${name(e)}`);
  }
  for (const e of document.querySelectorAll(window.isMadeUp ? 'none' : 'button, .button, h2, legend')) {
    if (e.scrollWidth > e.clientWidth + 1 && e.checkVisibility()) found.push(`wider than its room: ${name(e)}`);
  }
  const layer = once((e) => e.closest('#menu, #panel, toast-bar, .toasts, .detail, undo-screen .wide, .sticky, header') ?? document.body);
  leaves.sort((a, b) => a.box.top - b.box.top);
  for (let i = 0; i < leaves.length; i += 1) {
    const a = leaves[i];
    for (let j = i + 1; j < leaves.length && leaves[j].box.top < a.box.bottom - 3; j += 1) {
      const b = leaves[j];
      const across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
      const along = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
      if (!(across > 2 && along > 3)) continue;
      if (a.e === b.e || a.e.contains(b.e) || b.e.contains(a.e)) continue;
      if (layer(a.e) === layer(b.e)) found.push(`overlap: ${name(a.e)} and ${name(b.e)}`);
    }
  }
  const stops = [...document.querySelectorAll('button.stop')].filter(visible).map((e) => e.getBoundingClientRect());
  if (!stops.some((box) => box.top >= 0 && box.left >= 0 && box.bottom <= innerHeight && box.right <= innerWidth)) {
    found.push('STOP is not on the screen');
  }
  if (document.documentElement.scrollWidth > innerWidth) found.push('the page is too wide');
  return [...new Set(found)];
}
