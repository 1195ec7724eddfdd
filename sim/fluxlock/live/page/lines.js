// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0
// @ts-check
"use strict";

// How the panels draw a trace of more points than pixels: upright lines, one per column of pixels, from the least to the
// largest value there. A browser strokes an upright line ten times as fast as a slanted one.

// @ts-ignore: uPlot comes from its own file
const slanted = uPlot.paths.linear();

/** Paths of a series as uPlot takes them. @param {any} plot @param {number} series @param {number} from @param {number} to */
function lines(plot, series, from, to) {
  const { left, top, width, height } = plot.bbox;
  if (to - from < width) return slanted(plot, series, from, to);
  const times = plot.data[0], values = plot.data[series], x = plot.scales.x, y = plot.scales[plot.series[series].scale];
  const perSecond = width / (x.max - x.min), perUnit = height / (y.max - y.min);
  const stroke = new Path2D();
  let column = -1, low = 0, high = 0, last = 0;
  const upright = () => {
    if (column < 0) return;
    const more = Math.max(0, (1 - high + low) / 2);  // a level is a pixel thick
    stroke.moveTo(column, low - more);
    stroke.lineTo(column, high + more);
  };
  for (let k = from; k <= to; k++) {
    const value = values[k];
    if (value === null || value === undefined) {
      upright();
      column = -1;
      continue;
    }
    const place = Math.round(left + (times[k] - x.min) * perSecond), level = top + (y.max - value) * perUnit;
    if (place === column) {
      if (level < low) low = level;
      if (level > high) high = level;
    } else {
      upright();
      const joined = column >= 0 && place - column <= 1;
      if (column >= 0 && !joined) {
        stroke.moveTo(column, last);
        stroke.lineTo(place, level);
      }
      low = joined ? Math.min(last, level) : level;
      high = joined ? Math.max(last, level) : level;
      column = place;
    }
    last = level;
  }
  upright();
  return { stroke, fill: null, clip: null, band: null, gaps: null, flags: 0 };
}
