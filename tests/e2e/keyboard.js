// Plays generated histories of keyboards (tests/web/keyboards.mjs) on the page; returns what went wrong.
async (histories) => {
  const { page } = document.querySelector('app-bar');
  const { helm, connection } = page;
  const made = {
    button: document.createElement('button'), select: document.createElement('select'), text: document.createElement('input'),
    range: Object.assign(document.createElement('input'), { type: 'range' }), dialog: document.createElement('dialog'),
  };
  made.dialog.append(document.createElement('button'));
  document.body.append(...Object.values(made));
  const places = { ...made, body: document.body, dialog: made.dialog.firstChild };
  const until = async (isSo) => {
    for (let i = 0; i < 300 && !isSo(); i += 1) await new Promise((done) => setTimeout(done, 10));
    return isSo();
  };
  const robot = { ...page.store.state.robot, you_are_pilot: true };
  const answer = (mode, emergency) => page.follow({ ...robot, mode, emergency, fault: null });
  const begin = (mode) => answer(mode, false);
  connection.say = (what) => (what === 'stop' && answer('stopped', true), true);
  const hide = (isHidden) => {
    Object.defineProperty(document, 'hidden', { get: () => isHidden, configurable: true });
    document.dispatchEvent(new Event('visibilitychange'));
  };
  const wrong = [];
  const counts = { steps: 0, stops: 0, driven: 0 };
  for (const { seed, keyboard, steps } of histories) {
    let target = document.body;
    made.dialog.close();
    dispatchEvent(new Event('blur'));
    begin('train');
    for (const [i, step] of steps.entries()) {
      const wasMoving = helm.mode !== 'stopped';
      if (step.type === 'silence' || step.type === 'unlink') step.type = 'blur'; // these take time: tests/web/keys.test.mjs
      if (step.type === 'focus') {
        target = places[step.on];
        if (step.on === 'dialog') made.dialog.showModal();
        else made.dialog.close();
        if (target === document.body) document.activeElement?.blur();
        else target.focus();
      } else if (step.type === 'train' || step.type === 'autonomous') begin(step.type);
      else if (step.type === 'hidden') {
        hide(true);
        hide(false);
      } else if (step.type === 'blur') dispatchEvent(new Event('blur'));
      else {
        const event = step.init ? new KeyboardEvent(step.type, { ...step.init, bubbles: true, cancelable: true }) : new Event(step.type, { bubbles: true });
        target.dispatchEvent(event);
      }
      if (step.isStop && !(await until(() => helm.mode === 'stopped'))) wrong.push(['not stopped', seed, i, keyboard, step]);
      const { held } = helm;
      if (held && (helm.hasStick ? !step.allowed.length : !step.allowed.includes(held))) wrong.push(['drives on', held, seed, i, keyboard, steps.slice(Math.max(0, i - 4), i + 1)]);
      counts.steps += 1;
      counts.stops += Number(step.isStop && wasMoving);
      counts.driven += Number(held !== null);
    }
  }
  made.dialog.close();
  for (const one of Object.values(made)) one.remove();
  delete connection.say;
  dispatchEvent(new Event('blur'));
  return { wrong, counts };
}
