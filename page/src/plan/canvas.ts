/** Canvases that are as sharp as the screen, and drawn at most once a frame. */

export interface Surface {
  context: CanvasRenderingContext2D;
  width: number;
  height: number;
}

/** Sizes of boxes that are watched: to read one in each frame would have the browser lay the page out each time. */
const sizes = new WeakMap<Element, readonly [width: number, height: number]>();

/** Watch the sizes of boxes, and call `changed` when they are known and whenever they change; return what stops it. */
export function watchSizes(boxes: readonly Element[], changed: () => void): () => void {
  const observer = new ResizeObserver((entries) => {
    for (const { target, contentRect } of entries) sizes.set(target, [contentRect.width, contentRect.height]);
    changed();
  });
  boxes.forEach((box) => observer.observe(box));
  return () => {
    observer.disconnect();
    boxes.forEach((box) => sizes.delete(box));
  };
}

/** The size of a box without its border [CSS pixels]. */
export function sizeOf(box: Element): readonly [width: number, height: number] {
  return sizes.get(box) ?? [box.clientWidth, box.clientHeight];
}

/** Fit a canvas to its box; return its size in CSS pixels. */
export function fitted(canvas: HTMLCanvasElement): Surface {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = sizeOf(canvas);
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

/** What waits to be drawn, the first one in the next frame. */
const queue: (() => void)[] = [];

function drawFirst(): void {
  try {
    queue[0]?.();
  } finally {
    queue.shift();
    if (queue.length > 0) requestAnimationFrame(drawFirst);
  }
}

/** As `oncePerFrame`, but of all that is drawn so only one is in a frame: many small pictures must not hold it up. */
export function onePerFrame(draw: () => void): () => void {
  let isWaiting = false;
  return () => {
    if (isWaiting) return;
    isWaiting = true;
    queue.push(() => {
      isWaiting = false;
      draw();
    });
    if (queue.length === 1) requestAnimationFrame(drawFirst);
  };
}
