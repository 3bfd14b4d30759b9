/* Before viser's own client: where no graphics processor draws, a picture costs a second or more,
   and no other part of the page can be shown while one is drawn. So one is begun once the one
   before is done, and when something may have changed; with fewer pixels while the camera moves,
   and only as many at rest as are drawn in due time. */
(() => {
  const SOFTWARE = /swiftshader|llvmpipe|softpipe|software/i;
  /** Pixels of the picture for one of the screen, along each side; each has twice the last's. */
  const RATIOS = [0.25, 0.35, 0.5, 0.7, 1];
  /** How pictures are drawn: level of sharpness at first and at least, longest time that one may
      take, and the share of its time that is left to the rest of the page after it, ms. */
  const MOVING = { level: 1, least: 0, limit: 150, rest: 0.3 };
  const STILL = { level: 2, least: 1, limit: 800, rest: 3 };
  /** Sharpness that took too long is not tried again for this long, ms. */
  const TRY_AGAIN_MS = 60000;
  const LONGEST_REST_MS = 1500;
  /** The camera glides on for a while after the pointer. */
  const GLIDE_MS = 600;
  /** Pictures follow a change for this long: textures and fonts arrive late. */
  const LIVELY_MS = 1500;
  /** A picture asked for is drawn after this time whatever is known of changes. */
  const LATEST_MS = 10000;
  const POLL_MS = 20;
  /** How often a view that is out of sight looks whether it is seen again, ms. */
  const HIDDEN_MS = 300;
  /** A fence that is not reached within this time is none. */
  const FENCE_MS = 30000;

  if (!isSoftware()) return;
  const search = new URLSearchParams(location.search);
  search.set('fixedDpr', RATIOS[STILL.level]);
  history.replaceState(null, '', `?${search}`);

  const ask = window.requestAnimationFrame.bind(window);
  const cancel = window.cancelAnimationFrame.bind(window);
  const contexts = new Set();
  let waiting = new Map();
  let lastId = 0;
  let isDrawing = false;
  let timer;
  let ratio = RATIOS[STILL.level];
  let changedAt = performance.now();
  let movedAt = -Infinity;
  let begunAt = -Infinity;
  let took = 0;
  let earliest = 0;
  let pictures = 0;
  let rest;

  const change = () => {
    changedAt = performance.now();
    next();
  };
  const move = (event) => {
    if (event.type === 'pointermove' && event.buttons === 0) return;
    movedAt = performance.now();
    sharpen(MOVING);
    change();
  };
  for (const kind of ['pointerdown', 'pointermove', 'pointerup', 'wheel', 'keydown']) {
    addEventListener(kind, move, { capture: true, passive: true });
  }
  addEventListener('resize', change);
  document.addEventListener('visibilitychange', change);
  document.fonts?.addEventListener('loadingdone', change);
  const PlainWorker = window.Worker;
  window.Worker = class extends PlainWorker {
    constructor(...options) {
      super(...options);
      this.addEventListener('message', change);
    }
  };
  const getContext = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    if (kind !== 'webgl2') return getContext.call(this, kind, options);
    const context = getContext.call(this, kind, { ...options, antialias: false });
    if (context) contexts.add(context);
    return context;
  };

  window.requestAnimationFrame = (picture) => {
    lastId -= 1;
    waiting.set(lastId, picture);
    next();
    return lastId;
  };
  window.cancelAnimationFrame = (id) => (id < 0 ? void waiting.delete(id) : cancel(id));

  function next() {
    clearTimeout(timer);
    if (isDrawing || waiting.size === 0) return;
    if (window.frameElement?.offsetParent === null) {
      timer = setTimeout(next, HIDDEN_MS);
      return;
    }
    const now = performance.now();
    const isLively = now - changedAt < LIVELY_MS + 2 * took;
    const due = isLively ? earliest : Math.max(earliest, begunAt + LATEST_MS);
    if (now < due) timer = setTimeout(next, due - now);
    else {
      isDrawing = true;
      ask(draw);
    }
  }

  function draw(at) {
    const due = waiting;
    waiting = new Map();
    begunAt = performance.now();
    for (const picture of due.values()) {
      try {
        picture(at);
      } catch (error) {
        reportError(error);
      }
    }
    const context = shown();
    if (!context) return void done(null);
    const fence = context.fenceSync(context.SYNC_GPU_COMMANDS_COMPLETE, 0);
    context.flush();
    setTimeout(() => settle(context, fence), 0);
  }

  function settle(context, fence) {
    const isDone =
      !fence ||
      context.isContextLost() ||
      context.getSyncParameter(fence, context.SYNC_STATUS) === context.SIGNALED ||
      performance.now() - begunAt > FENCE_MS;
    if (!isDone) return void setTimeout(() => settle(context, fence), POLL_MS);
    if (fence) context.deleteSync(fence);
    done(context);
  }

  function done(context) {
    const now = performance.now();
    took = now - begunAt;
    const way = now - movedAt < GLIDE_MS ? MOVING : STILL;
    earliest = now + Math.min(took * way.rest, LONGEST_REST_MS);
    isDrawing = false;
    document.documentElement.dataset.pictures = String(++pictures);
    if (context) {
      if (ratio === RATIOS[way.level]) judge(way, now);
      sharpen(way);
    }
    next();
  }

  /** Change how sharp pictures are by what the last one of that sharpness took. */
  function judge(way, now) {
    if (took > way.limit && way.level > way.least) {
      way.level -= 1;
      way.triedAt = now;
    } else if (took < way.limit / 3 && now - (way.triedAt ?? -Infinity) > TRY_AGAIN_MS) {
      way.level = Math.min(way.level + 1, RATIOS.length - 1);
    }
  }

  /** Let the next picture have the pixels that it should; the client then draws one. */
  function sharpen(way) {
    clearTimeout(rest);
    if (way === MOVING) rest = setTimeout(() => sharpen(STILL), GLIDE_MS);
    const settings = window.__viserTestpoints?.devSettings;
    if (isDrawing || !settings || ratio === RATIOS[way.level]) return;
    ratio = RATIOS[way.level];
    earliest = 0;
    changedAt = performance.now();
    settings.set({ fixedDpr: ratio });
  }

  function shown() {
    return [...contexts].find(({ canvas }) => canvas.isConnected && canvas.width > 0);
  }

  function isSoftware() {
    const gl = document.createElement('canvas').getContext('webgl2');
    if (!gl) return false;
    const info = gl.getExtension('WEBGL_debug_renderer_info');
    const name = gl.getParameter(info?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER);
    gl.getExtension('WEBGL_lose_context')?.loseContext();
    return SOFTWARE.test(String(name));
  }
})();
