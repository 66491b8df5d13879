// Builds elements without a framework.
// The page's policy forbids inline styles but allows `element.style`, which sets sizes that depend on data.

/**
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag
 * @param {Record<string, any>} [props]  `on…` adds a listener; all others set an attribute
 * @param {...(Node | string | null | undefined | false)} children
 * @returns {HTMLElementTagNameMap[T]}
 */
export function h(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), name === 'onclick' || name === 'onsubmit' ? once(value) : value);
    else element.setAttribute(name, value === true ? '' : String(value));
  }
  append(element, children);
  return element;
}

const PATIENCE_MS = 5000;

/** Ignore a second tap until the first one's action has ended, but not for long if the action hangs. @param {(event: Event) => unknown} act */
function once(act) {
  let untilMs = -Infinity;
  return (/** @type {Event} */ event) => {
    if (performance.now() < untilMs) {
      event.preventDefault();
      return;
    }
    const control = /** @type {Element} */ (event.currentTarget);
    const answer = act(event);
    if (!(answer instanceof Promise)) return;
    untilMs = performance.now() + PATIENCE_MS;
    answer.finally(() => {
      untilMs = -Infinity;
      settle(control);
    });
  };
}

/** @param {Element} parent @param {(Node | string | null | undefined | false)[]} children */
export function append(parent, children) {
  parent.append(.../** @type {(Node | string)[]} */ (children.filter((c) => c || c === '')));
}

/**
 * Replace the children. The focus stays on the element of the same name, so that keyboard users do not find themselves at the top of the page. @param {Element} parent @param {...(Node | string | null | false)}
 * children
 */
export function fill(parent, ...children) {
  const { activeElement: focused } = document;
  const name = focused && parent.contains(focused) ? nameOf(focused) : '';
  parent.replaceChildren();
  append(parent, children);
  if (!name) return;
  const same = [.../** @type {NodeListOf<HTMLElement>} */ (parent.querySelectorAll('a, button, input, select'))]
    .find((control) => nameOf(control) === name && control.getClientRects().length);
  same?.focus({ preventScroll: true });
}

/** @param {any} control */
const nameOf = (control) => control.getAttribute('aria-label') ?? (control.textContent || control.value);

/** Set text only if it differs, to avoid needless layout. @param {Node} node @param {string} text */
export function say(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** True if an event means that the pointer was lifted. If another mouse button is still down, browsers send only a move event. @param {PointerEvent} event */
export const hasLetGo = ({ pointerType, buttons }) => pointerType === 'mouse' && !(buttons & 1);

const SETTLE_MS = 300;
/** @type {WeakMap<Element, ReturnType<typeof setTimeout>>} */
const settling = new WeakMap();

/** Ignore taps on an element that has just appeared, because the finger aimed at the previous content. @param {Element} element */
export function settle(element) {
  clearTimeout(settling.get(element));
  element.classList.add('fresh');
  settling.set(element, setTimeout(() => element.classList.remove('fresh'), SETTLE_MS));
}

const SVG = 'http://www.w3.org/2000/svg';

/**
 * @param {string} tag
 * @param {Record<string, string | number>} props
 * @param {...Element} children
 */
export function svg(tag, props = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(props)) element.setAttribute(name, String(value));
  element.append(...children);
  return element;
}

/** @type {Record<string, string>} outlines on a 24x24 grid */
const PATHS = {
  forward: 'M12 20V5M5 12l7-7 7 7',
  backward: 'M12 4v15M5 12l7 7 7-7',
  left: 'M9 5 4 10l5 5M4 10h9a7 7 0 0 1 7 7v2',
  right: 'm15 5 5 5-5 5M20 10h-9a7 7 0 0 0-7 7v2',
  spin_left: 'M4 4v6h6M4.6 10a8 8 0 1 1-.5 4',
  spin_right: 'M20 4v6h-6M19.4 10a8 8 0 1 0 .5 4',
  pilot: 'M12 11.5a4 4 0 1 0 0-8 4 4 0 0 0 0 8zM4 21c0-4.5 3.6-7 8-7s8 2.5 8 7',
  robot: 'M5 9h14v10H5zM12 9V5M9.5 4h5M9 13v2M15 13v2M2.5 12v4M21.5 12v4',
  nobody: 'M8 5v14M16 5v14',
  menu: 'M4 7h16M4 12h16M4 17h16',
  more: 'M4 12a1 1 0 1 0 2 0 1 1 0 1 0-2 0M11 12a1 1 0 1 0 2 0 1 1 0 1 0-2 0M18 12a1 1 0 1 0 2 0 1 1 0 1 0-2 0',
  back: 'm14 5-7 7 7 7',
  redo: 'm15 6 5 5-5 5M20 11h-9a6 6 0 0 0 0 12',
  play: 'M8 5v14l11-7z',
  undo: 'M9 6 4 11l5 5M4 11h9a6 6 0 0 1 0 12',
  pin: 'M9 3h6l-1 7 4 4H6l4-4zM12 14v7',
  tilt: 'M8 3h8v18H8zM3 8l-1 4 1 4M21 8l1 4-1 4',
};

/** The icons that a robot's driver declares, by move: the name of an outline, or a character. @type {Map<string, string>} */
export const signs = new Map();

/** @param {string} name */
export function icon(name) {
  const sign = signs.get(name) ?? name;
  const outline = PATHS[sign] ?? PATHS[name];
  const drawn = svg(outline ? 'path' : 'text', outline ? { d: outline } : { x: 12, y: 18, 'text-anchor': 'middle', 'font-size': 16, fill: 'currentColor', stroke: 'none' });
  if (!outline) drawn.textContent = sign === name ? name.slice(0, 2) : sign;
  return svg('svg', { viewBox: '0 0 24 24', class: 'icon', 'aria-hidden': 'true' }, drawn);
}
