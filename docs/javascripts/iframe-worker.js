// A worker in a hidden frame, for pages that are opened as files: browsers refuse workers there. The site's search
// runs in one. It needs messages both ways, and the index that the offline plugin writes as a script.
if (location.protocol === "file:") {
  window.IFrameWorker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.documentElement.append(frame);
      this.scope = frame.contentWindow;
      this.scope.postMessage = (data) => {
        const event = new MessageEvent("message", { data });
        this.dispatchEvent(event);
        if (this.onmessage) this.onmessage(event);
      };
      this.ready = new Promise((loaded, failed) => {
        const script = frame.contentDocument.createElement("script");
        Object.assign(script, { src: url, onload: loaded, onerror: failed });
        frame.contentDocument.documentElement.append(script);
      });
    }
    postMessage(data) {
      const event = () => new MessageEvent("message", { data });
      this.ready.then(() => this.scope.dispatchEvent(event()), () => this.dispatchEvent(new Event("error")));
    }
    terminate() {}
  };
  window.Worker = window.IFrameWorker;
}
