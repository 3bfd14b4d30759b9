/* Before viser's own client: where no graphics processor draws, a picture costs seconds. One is
   begun only once the one before is done, half as sharp, and when something may have changed; no
   page is kept from leaving by a queue of pictures that nobody sees. */
(() => {
  const SOFTWARE = /swiftshader|llvmpipe|softpipe|software/i;
  /** After the last change the client's own motions may go on for this long, ms. */
  const LIVELY_MS = 1500;
  /** How often the state of a picture is looked at, and of a view that is out of sight, ms. */
  const POLL_MS = 50;
  const HIDDEN_MS = 500;
  const ask = window.requestAnimationFrame.bind(window);
  const ratio = window.devicePixelRatio;
  let gl = null;
  let isSlow = false;
  let wokenAt = performance.now();
  let drawnFor = 0;
  let pictures = 0;
  let waiting = new Map();
  let last = 0;
  let isDue = false;

  const wake = () => {
    wokenAt = performance.now();
  };
  for (const kind of ['pointerdown', 'pointermove', 'wheel', 'keydown', 'resize', 'message']) {
    window.addEventListener(kind, wake, { capture: true, passive: true });
  }
  const Plain = window.Worker;
  window.Worker = class extends Plain {
    constructor(...options) {
      super(...options);
      this.addEventListener('message', wake);
    }
  };

  const getContext = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...options) {
    const context = getContext.call(this, kind, ...options);
    if (context && kind === 'webgl2') {
      const info = context.getExtension('WEBGL_debug_renderer_info');
      const name = context.getParameter(info?.UNMASKED_RENDERER_WEBGL ?? context.RENDERER);
      isSlow = SOFTWARE.test(String(name));
      gl = context;
    }
    return context;
  };
  Object.defineProperty(window, 'devicePixelRatio', {
    get: () => (isSlow ? ratio / 2 : ratio),
  });

  const isHidden = () => window.innerWidth === 0 || window.frameElement?.offsetParent === null;
  const isQuiet = () => performance.now() - wokenAt > LIVELY_MS + drawnFor;

  function draw(at) {
    const due = waiting;
    waiting = new Map();
    const begun = performance.now();
    for (const picture of due.values()) picture(at);
    pictures += 1;
    document.documentElement.dataset.pictures = String(pictures);
    const fence = gl?.fenceSync?.(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl?.flush?.();
    const settle = () => {
      const isDone = !fence || gl.isContextLost() ||
        gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.SIGNALED;
      if (!isDone) return void setTimeout(settle, POLL_MS);
      if (fence) gl.deleteSync(fence);
      drawnFor = performance.now() - begun;
      isDue = false;
      // As long as it took is left to the rest of the page.
      if (waiting.size > 0) setTimeout(next, Math.min(drawnFor, 2000));
    };
    setTimeout(settle, 0);
  }

  function next() {
    if (isDue || waiting.size === 0) return;
    if (isHidden()) return void setTimeout(next, HIDDEN_MS);
    if (isQuiet() && pictures > 2) return void setTimeout(next, POLL_MS);
    isDue = true;
    ask(draw);
  }

  window.requestAnimationFrame = (picture) => {
    if (!isSlow) return ask(picture);
    last -= 1;
    waiting.set(last, picture);
    next();
    return last;
  };
  const cancel = window.cancelAnimationFrame.bind(window);
  window.cancelAnimationFrame = (id) => (id < 0 ? void waiting.delete(id) : cancel(id));
})();
