// The connection to `gyre watch`: opened again whenever it is lost.

const SILENCE_MS = 5000; // The server sends a report each second.
const RETRY_MS = [500, 1000, 2000, 4000];

/** Receives until the page is closed. `layers()` names what is wanted of the pictures. */
export class Connection {
  constructor({ onText, onPicture, onState, layers }) {
    Object.assign(this, { onText, onPicture, onState, layers });
    this.failures = 0;
    this.received = 0;
    this.open();
    setInterval(() => this.look(), 1000);
    // Nobody looks at a hidden page: it asks for no picture.
    document.addEventListener("visibilitychange", () => this.ask());
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/stream`);
    this.socket.binaryType = "arraybuffer";
    this.heard = performance.now();
    this.socket.onopen = () => this.ask();
    this.socket.onmessage = (event) => this.receive(event.data);
    this.socket.onclose = () => this.lost();
  }

  ask() {
    if (this.socket.readyState === WebSocket.OPEN) {
      this.socket.send(document.hidden ? "" : this.layers());
    }
  }

  async receive(data) {
    this.heard = performance.now();
    this.failures = 0;
    this.onState(true);
    if (typeof data === "string") {
      this.received += data.length;
      this.onText(JSON.parse(data));
    } else {
      this.received += data.byteLength;
      this.onPicture(...(await decode(data)));
    }
  }

  lost() {
    this.onState(false);
    const wait = RETRY_MS[Math.min(this.failures, RETRY_MS.length - 1)];
    this.failures += 1;
    setTimeout(() => this.open(), wait);
  }

  look() {
    if (this.socket.readyState === WebSocket.OPEN && performance.now() - this.heard > SILENCE_MS) {
      this.socket.onclose = null;
      this.socket.close();
      this.lost();
    }
  }

  /** Returns the bytes that were received since the last call. */
  takeReceived() {
    const received = this.received;
    this.received = 0;
    return received;
  }
}

// A picture: the length of the header (u32), the header in JSON, and the deflated bytes.
async function decode(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const deflated = new Blob([new Uint8Array(buffer, 4 + length)]).stream();
  const inflated = deflated.pipeThrough(new DecompressionStream("deflate-raw"));
  return [header, await new Response(inflated).arrayBuffer()];
}
