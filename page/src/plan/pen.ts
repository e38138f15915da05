/** Shapes that furniture and figures are drawn with, in metres. */

export class Pen {
  constructor(readonly context: CanvasRenderingContext2D) {}

  private finish(fill: string | null, edge: string | null): void {
    const { context } = this;
    if (fill) {
      context.fillStyle = fill;
      context.fill();
    }
    if (edge) {
      context.strokeStyle = edge;
      context.stroke();
    }
  }

  box(left: number, bottom: number, right: number, top: number, fill: string | null, radius = 0.04, edge: string | null = null): void {
    const [width, height] = [right - left, top - bottom];
    this.context.beginPath();
    this.context.roundRect(left, bottom, width, height, Math.max(0, Math.min(radius, width / 2, height / 2)));
    this.finish(fill, edge);
  }

  disc(x: number, y: number, radius: number, fill: string | null, edge: string | null = null): void {
    this.ellipse(x, y, radius, radius, fill, edge);
  }

  ellipse(x: number, y: number, along: number, across: number, fill: string | null, edge: string | null = null): void {
    this.context.beginPath();
    this.context.ellipse(x, y, Math.max(0, along), Math.max(0, across), 0, 0, 2 * Math.PI);
    this.finish(fill, edge);
  }

  line(x0: number, y0: number, x1: number, y1: number, color: string, width?: number): void {
    const { context } = this;
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x1, y1);
    if (width !== undefined) context.lineWidth = width;
    context.strokeStyle = color;
    context.stroke();
  }
}
