/** Columns of Parquet tables as typed arrays. */

import { decompress } from "fzstd";
import type { AsyncBuffer, DecodedArray, FileMetaData } from "hyparquet";
import { parquetMetadataAsync, parquetRead } from "hyparquet";

export interface Words {
  codes: Int32Array;
  words: string[];
}

const compressors = {
  ZSTD: (input: Uint8Array, outputLength: number): Uint8Array =>
    decompress(input, new Uint8Array(outputLength)),
};
const micros = (value: bigint): number => Number(value);
const parsers = { timestampFromMicroseconds: micros };

/** A table that is read column by column. */
export class Table {
  private constructor(
    private readonly file: AsyncBuffer,
    readonly metadata: FileMetaData,
  ) {}

  static async open(file: AsyncBuffer): Promise<Table> {
    return new Table(file, await parquetMetadataAsync(file));
  }

  get rows(): number {
    return Number(this.metadata.num_rows);
  }

  /** Whether the table has a column. */
  has(column: string): boolean {
    return this.metadata.schema.some((element) => element.name === column);
  }

  /** First row of each row group, and the number of rows at the end. */
  get groupStarts(): number[] {
    const starts = [0];
    for (const group of this.metadata.row_groups) {
      starts.push(starts[starts.length - 1]! + Number(group.num_rows));
    }
    return starts;
  }

  /** The least value of a column in each row group, as its statistics say; null where they don't. */
  groupMinima(column: string): (number | null)[] {
    return this.metadata.row_groups.map((group) => {
      const chunk = group.columns.find((entry) => entry.meta_data?.path_in_schema[0] === column);
      const least = chunk?.meta_data?.statistics?.min_value;
      return least === undefined ? null : Number(least);
    });
  }

  /** Numbers of a column; NaN where one is missing, 1 and 0 for true and false. */
  async numbers(column: string, from = 0, to = this.rows): Promise<Float64Array> {
    const values = new Float64Array(to - from);
    await this.read(column, from, to, (data, first) => {
      for (let i = 0; i < data.length; i++) {
        const at = first + i - from;
        if (at < 0 || at >= values.length) continue;
        const value = data[i] as number | bigint | boolean | null | undefined;
        values[at] = value === null || value === undefined ? NaN : Number(value);
      }
    });
    return values;
  }

  /** Words of a column as numbers, -1 where one is missing, and the list of words. */
  async words(column: string, from = 0, to = this.rows): Promise<Words> {
    const codes = new Int32Array(to - from).fill(-1);
    const words: string[] = [];
    const codeOfText = new Map<string, number>();
    await this.read(column, from, to, (data, first) => {
      for (let i = 0; i < data.length; i++) {
        const at = first + i - from;
        const value = data[i] as string | null | undefined;
        if (at < 0 || at >= codes.length || value === null || value === undefined) continue;
        let code = codeOfText.get(value);
        if (code === undefined) {
          code = words.length;
          codeOfText.set(value, code);
          words.push(value);
        }
        codes[at] = code;
      }
    });
    return { codes, words };
  }

  private async read(
    column: string,
    rowStart: number,
    rowEnd: number,
    take: (data: DecodedArray, first: number) => void,
  ): Promise<void> {
    if (rowEnd <= rowStart) return;
    await parquetRead({
      file: this.file,
      metadata: this.metadata,
      columns: [column],
      rowStart,
      rowEnd,
      compressors,
      parsers,
      onChunk: (chunk) => take(chunk.columnData, chunk.rowStart),
    });
  }
}
