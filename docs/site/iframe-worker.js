/* Lets the search work where the site is read from a disk: browsers give a page of file:// no worker. */
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const script = new URL(url, location);
      const frame = document.createElement("iframe");
      frame.hidden = true;
      frame.title = "search";
      this.ready = new Promise((done) => {
        const begin = () => {
          document.body.append(frame);
          const inside = frame.contentWindow;
          inside.postMessage = (data) => {
            const message = new MessageEvent("message", { data });
            this.dispatchEvent(message);
            this.onmessage?.(message);
          };
          inside.importScripts = (...names) =>
            names.reduce((before, name) => before.then(() => load(name)), Promise.resolve());
          const load = (name) =>
            new Promise((loaded) => {
              const one = inside.document.createElement("script");
              one.src = new URL(name, script);
              one.onload = loaded;
              inside.document.head.append(one);
            });
          load(script).then(() => done(inside));
        };
        document.body ? begin() : addEventListener("DOMContentLoaded", begin);
      });
    }
    postMessage(data) {
      this.ready.then((inside) => inside.dispatchEvent(new MessageEvent("message", { data })));
    }
    terminate() {}
  };
}
