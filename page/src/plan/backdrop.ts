/** The home in its light, as one picture: made anew only when its size, its furniture, a lamp or the sky changes. */

import type { Run } from "../data/run";
import type { Colors } from "../theme";
import type { Frame } from "./frame";
import { drawGround } from "./ground";
import { Light } from "./light";

/** What the picture shows, beside the light: a key of what is drawn, and whether pieces and light are. */
export interface Stage {
  frame: Frame;
  width: number;
  height: number;
  ratio: number;
  colors: Colors;
  withFurniture: boolean;
  withLight: boolean;
}

export class Backdrop {
  private readonly ground = document.createElement("canvas");
  private readonly light = new Light();
  private drawn = "";

  constructor(private readonly run: Run) {}

  /** What the picture of a moment depends on. */
  key(stage: Stage, us: number): string {
    const key = this.groundKey(stage, us);
    return stage.withLight ? `${key} ${this.light.key(this.run, us)}` : key;
  }

  private groundKey({ frame, width, height, ratio, colors, withFurniture }: Stage, us: number): string {
    return [width, height, ratio, frame.key, colors.ground, withFurniture, this.run.moved.count(us)].join();
  }

  picture(stage: Stage, us: number): HTMLCanvasElement {
    const key = this.groundKey(stage, us);
    if (key !== this.drawn) {
      this.drawn = key;
      this.ground.width = Math.round(stage.width * stage.ratio);
      this.ground.height = Math.round(stage.height * stage.ratio);
      drawGround(this.ground, this.run.home, stage.frame, stage.ratio, stage.colors, stage.withFurniture ? this.run.moved.at(us) : []);
    }
    return stage.withLight ? this.light.of(this.ground, key, this.run, us, stage.frame, stage.ratio) : this.ground;
  }
}
