/** From lattice units and metres to pixels of a canvas: the plan fits it, and can be zoomed. */

import type { Home } from "../data/home";

const EDGE = 0.03;
/** Pixels below the plan, for its scale. */
export const FOOT = 18;

export class Frame {
  private constructor(
    readonly scale: number,
    private readonly left: number,
    private readonly bottom: number,
    private readonly home: Home,
  ) {}

  /**
   * The frame in which a home fits a canvas, zoomed about its middle and shifted.
   *
   * A corner at the top left [px] stays free, as for a clock: the home is beside or below it, whichever is larger.
   */
  static fit(home: Home, width: number, height: number, zoom = 1, shift: readonly [number, number] = [0, 0], corner: readonly [number, number] = [0, 0]): Frame {
    const [x0, y0, x1, y1] = home.facts.bounds;
    const edge = 0.35 + EDGE * Math.max(x1 - x0, y1 - y0);
    const [wide, tall] = [x1 - x0 + 2 * edge, y1 - y0 + 2 * edge];
    const scaleWithin = (left: number, top: number): number => Math.min((width - left) / wide, (height - FOOT - top) / tall);
    const within = (left: number, top: number): Frame => {
      const scale = scaleWithin(left, top) * zoom;
      const x = (width + left) / 2 - ((x0 + x1) / 2) * scale + shift[0];
      const y = (height - FOOT + top) / 2 + ((y0 + y1) / 2) * scale + shift[1];
      return new Frame(scale, x, y, home);
    };
    const [right, below] = corner;
    const whole = scaleWithin(0, 0);
    const isFree = (width - (x1 - x0) * whole) / 2 > right || (height - FOOT - (y1 - y0) * whole) / 2 > below;
    if (isFree) return within(0, 0);
    return scaleWithin(right, 0) > scaleWithin(0, below) ? within(right, 0) : within(0, below);
  }

  /** What distinguishes it from other frames of its home. */
  get key(): string {
    return [this.scale, this.left, this.bottom].join();
  }

  /** The frame that shows a part of a home, as much as fits around a place [m] at a scale [px/m]. */
  static around(home: Home, width: number, height: number, x: number, y: number, scale: number): Frame {
    return new Frame(scale, width / 2 - x * scale, height / 2 + y * scale, home);
  }

  /** Pixels of a place in metres. */
  x(metres: number): number {
    return this.left + metres * this.scale;
  }

  y(metres: number): number {
    return this.bottom - metres * this.scale;
  }

  /** Pixels of a place in lattice units. */
  ux(units: number): number {
    return this.x(this.home.metres(units, 0));
  }

  uy(units: number): number {
    return this.y(this.home.metres(units, 1));
  }

  /** Have a context draw in metres, y upwards, at a ratio of its pixels to those of the screen. */
  enter(context: CanvasRenderingContext2D, ratio: number): void {
    const scale = this.scale * ratio;
    context.setTransform(scale, 0, 0, -scale, this.left * ratio, this.bottom * ratio);
  }

  /** The place [m] of a pixel. */
  place(px: number, py: number): [number, number] {
    return [(px - this.left) / this.scale, (this.bottom - py) / this.scale];
  }
}
