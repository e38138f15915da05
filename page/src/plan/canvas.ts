/** Canvases that are as sharp as the screen, and drawn at most once a frame. */

export interface Surface {
  context: CanvasRenderingContext2D;
  width: number;
  height: number;
}

/** Fit a canvas to its box; return its size in CSS pixels. */
export function fitted(canvas: HTMLCanvasElement): Surface {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  const context = canvas.getContext("2d")!;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { context, width, height };
}

/** A function that has `draw` called before the next frame, however often it is called itself. */
export function oncePerFrame(draw: () => void): () => void {
  let waiting = false;
  return () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  };
}
