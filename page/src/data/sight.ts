/**
 * The region that is visible from a place, exact in lattice units: triangular expansion through the
 * mesh of free space, as `fleet2d.kernels.visible_region` does it.
 */

import type { WallsFacts } from "../contract";

const WALL = -1;
const BUCKET = 512;

export class Walls {
  private readonly vertices: Int32Array;
  private readonly triangles: Int32Array;
  private readonly neighbors: Int32Array;
  private readonly buckets = new Map<number, number[]>();

  constructor(facts: WallsFacts) {
    this.vertices = Int32Array.from(facts.vertices);
    this.triangles = Int32Array.from(facts.triangles);
    this.neighbors = Int32Array.from(facts.neighbors);
    for (let t = 0; t * 3 < this.triangles.length; t++) this.fileTriangle(t);
  }

  private x(vertex: number): number {
    return this.vertices[2 * vertex]!;
  }

  private y(vertex: number): number {
    return this.vertices[2 * vertex + 1]!;
  }

  private corner(triangle: number, k: number): number {
    return this.triangles[3 * triangle + (k % 3)]!;
  }

  private fileTriangle(triangle: number): void {
    const corners = [0, 1, 2].map((k) => this.corner(triangle, k));
    const xs = corners.map((v) => Math.floor(this.x(v) / BUCKET));
    const ys = corners.map((v) => Math.floor(this.y(v) / BUCKET));
    for (let column = Math.min(...xs); column <= Math.max(...xs); column++) {
      for (let row = Math.min(...ys); row <= Math.max(...ys); row++) {
        const key = column * 65_536 + row;
        const bucket = this.buckets.get(key);
        if (bucket) bucket.push(triangle);
        else this.buckets.set(key, [triangle]);
      }
    }
  }

  /** The side of the line from corner k to the next that a point is on: positive is left. */
  private side(triangle: number, k: number, px: number, py: number): number {
    const a = this.corner(triangle, k);
    const b = this.corner(triangle, k + 1);
    const [ax, ay] = [this.x(a), this.y(a)];
    return (this.x(b) - ax) * (py - ay) - (this.y(b) - ay) * (px - ax);
  }

  /** A triangle that holds a point, -1 outside. */
  private locate(px: number, py: number): number {
    const key = Math.floor(px / BUCKET) * 65_536 + Math.floor(py / BUCKET);
    for (const triangle of this.buckets.get(key) ?? []) {
      if ([0, 1, 2].every((k) => this.side(triangle, k, px, py) >= 0)) return triangle;
    }
    return -1;
  }

  /** Outline of everything visible from a place [lattice], x and y in turn; empty in a wall. */
  outline(px: number, py: number): number[] {
    const start = this.locate(px, py);
    if (start < 0) return [];
    const right: number[] = [];
    const wall: number[] = [];
    for (let k = 0; k < 3; k++) this.lookThrough(px, py, start, k, right, wall);
    const outline: number[] = [];
    for (let i = 0; i < right.length; i++) {
      const left = right[i + 1 < right.length ? i + 1 : 0]!;
      this.pushEnds(px, py, right[i]!, left, wall[i]!, outline);
    }
    return outline;
  }

  /** Add where the two borders of a piece meet its wall. */
  private pushEnds(px: number, py: number, right: number, left: number, wall: number, outline: number[]): void {
    const triangle = Math.floor(wall / 3);
    const a = this.corner(triangle, wall % 3);
    const b = this.corner(triangle, (wall % 3) + 1);
    const [ux, uy] = [this.x(a) - px, this.y(a) - py];
    const [ex, ey] = [this.x(b) - this.x(a), this.y(b) - this.y(a)];
    for (const vertex of [right, left]) {
      const [vx, vy] = [this.x(vertex) - px, this.y(vertex) - py];
      const reach = (ux * ey - uy * ex) / (vx * ey - vy * ex);
      const [x, y] = [px + reach * vx, py + reach * vy];
      const n = outline.length;
      if (Number.isFinite(x) && (outline[n - 2] !== x || outline[n - 1] !== y)) outline.push(x, y);
    }
  }

  /** The edge of a triangle that it shares with another. */
  private entryEdge(triangle: number, from: number): number {
    for (let k = 0; k < 2; k++) if (this.neighbors[3 * triangle + k] === from) return k;
    return 2;
  }

  private lookThrough(px: number, py: number, triangle: number, edge: number, right: number[], wall: number[]): void {
    const stack = [3 * triangle + edge, this.corner(triangle, edge), this.corner(triangle, edge + 1)];
    while (stack.length > 0) {
      let coneLeft = stack.pop()!;
      const coneRight = stack.pop()!;
      let crossedEdge = stack.pop()!;
      let current = Math.floor(crossedEdge / 3);
      let beyond = this.neighbors[crossedEdge]!;
      const [rx, ry] = [this.x(coneRight) - px, this.y(coneRight) - py];
      let [lx, ly] = [this.x(coneLeft) - px, this.y(coneLeft) - py];
      while (beyond !== WALL) {
        const entry = this.entryEdge(beyond, current);
        const leftEdge = (entry + 2) % 3;
        const apex = this.corner(beyond, leftEdge);
        const [ox, oy] = [this.x(apex) - px, this.y(apex) - py];
        current = beyond;
        let following = leftEdge;
        if (rx * oy - ry * ox > 0) {
          following = (entry + 1) % 3;
          if (lx * oy - ly * ox < 0) {
            stack.push(3 * current + leftEdge, apex, coneLeft);
            coneLeft = apex;
            [lx, ly] = [ox, oy];
          }
        }
        crossedEdge = 3 * current + following;
        beyond = this.neighbors[crossedEdge]!;
      }
      right.push(coneRight);
      wall.push(crossedEdge);
    }
  }
}
