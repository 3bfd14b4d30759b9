/* Runs before viser's own client: gives its view the look of the page around it, tells that page
   whether the station is heard, and keeps out of the console what is no fault. */
(() => {
  /** viser's client tells of its progress; its faults are warnings and errors. */
  console.log = () => {};
  const warn = console.warn;
  console.warn = (...words) => {
    if (!String(words[0]).startsWith('THREE.Clock: This module has been deprecated.')) {
      warn.apply(console, words);
    }
  };
  const createObjectURL = URL.createObjectURL;
  URL.createObjectURL = (source) => {
    const isScript = source instanceof Blob && source.type.includes('javascript');
    const quiet = () => new Blob(['console.log = () => {};\n', source], { type: source.type });
    return createObjectURL.call(URL, isScript ? quiet() : source);
  };

  /** The sorter of Gaussian splats, which no scene of ours has, writes itself functions as text at
      start, which the policy of this page forbids; it gets some that do nothing. */
  window.Function = new Proxy(Function, {
    apply(target, self, words) {
      const isSorter = words[0] === 'humanName' && words[1] === 'throwBindingError';
      return isSorter ? () => () => {} : Reflect.apply(target, self, words);
    },
  });

  /** viser tries again only in a page that has the focus; a frame seldom has it. */
  Document.prototype.hasFocus = function () {
    return this.visibilityState === 'visible';
  };
  document.addEventListener('visibilitychange', () => window.dispatchEvent(new Event('focus')));
  const PlainWorker = window.Worker;
  window.Worker = class extends PlainWorker {
    constructor(...options) {
      super(...options);
      this.addEventListener('message', ({ data }) => {
        if (data?.type === 'connected' || data?.type === 'closed') tell(data.type === 'connected');
      });
    }
  };
  const tell = (isHeard) => parent.postMessage({ isSceneHeard: isHeard }, location.origin);

  /** Labels in light letters on a dark plate: the sky is never lighter than its middle tone. */
  const SHADES = [
    ['vec4(0.0, 0.0, 0.0, a)', 'vec4(0.93, 0.95, 0.97, a)'],
    ['vec4(1.0, 1.0, 1.0, 0.85 * vAlpha)', 'vec4(0.07, 0.1, 0.13, 0.72 * vAlpha)'],
  ];
  const shaderSource = WebGL2RenderingContext.prototype.shaderSource;
  WebGL2RenderingContext.prototype.shaderSource = function (shader, source) {
    const words = SHADES.reduce((text, [from, to]) => text.replace(from, to), source);
    shaderSource.call(this, shader, words);
  };

  /** A view of the past says so in itself, wherever it is shown, and of when as soon as it is told. */
  if (/\/replay\/[0-9a-f]+\/?$/.test(location.pathname)) {
    const mark = document.createElement('div');
    mark.id = 'then';
    mark.setAttribute('role', 'note');
    mark.textContent = 'Replay, not live';
    addEventListener('message', ({ source, origin, data }) => {
      if (source !== parent || origin !== location.origin) return;
      if (typeof data?.replayAt !== 'number') return;
      const [day, time] = new Date(data.replayAt).toISOString().slice(0, 19).split('T');
      mark.textContent = `At ${time}Z, not live`;
      mark.title = `The robot on ${day} at ${time}Z.`;
    });
    document.addEventListener('DOMContentLoaded', () => document.body.append(mark));
  }

  const around = window.frameElement?.ownerDocument;
  if (!around) return;
  const follow = () => {
    document.documentElement.dataset.theme = around.documentElement.dataset.theme ?? 'dark';
  };
  new MutationObserver(follow).observe(around.documentElement, {
    attributeFilter: ['data-theme'],
  });
  follow();
  for (const sheet of around.styleSheets) {
    for (const rule of sheet.cssRules) {
      if (rule.constructor.name !== 'CSSFontFaceRule') continue;
      const told = (name) => rule.style.getPropertyValue(name);
      const name = told('font-family').replaceAll('"', '');
      const face = new FontFace(name, told('src'), {
        weight: told('font-weight'),
        unicodeRange: told('unicode-range'),
      });
      document.fonts.add(face);
    }
  }
  const family = getComputedStyle(around.body).fontFamily;
  void document.fonts.load(`16px ${family}`);
  const font = Object.getOwnPropertyDescriptor(CanvasRenderingContext2D.prototype, 'font');
  Object.defineProperty(CanvasRenderingContext2D.prototype, 'font', {
    ...font,
    set(words) {
      font.set.call(this, words.replace(/px .*/, `px ${family}`));
    },
  });
})();
