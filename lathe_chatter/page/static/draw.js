// How signals, portraits, spectra and the chart are drawn; nothing here knows where they come from.
'use strict';

const SIGNALS = ['tool_displacement', 'tool_velocity', 'workpiece_displacement', 'workpiece_velocity'];
const MILLI = 1e3, MICRO = 1e6;

// Colours, asked of the style sheet once: a plot asks for some thirty each time it is drawn.
const colours = new Map();

function css(name) {
  if (!colours.has(name)) {
    colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  }
  return colours.get(name);
}

// A legend is no canvas: its marks take the colours of the style sheet, of whatever theme, by themselves.
function legend(names, dashes = [], filled = -1) {
  const mark = (u, k) => `var(--${names[k - 1]})`;
  const dash = (u, k) => (!dashes[k - 1]?.length ? 'solid' : dashes[k - 1][0] > 3 ? 'dashed' : 'dotted');
  return {show: true, live: false, markers: {stroke: mark, dash, fill: (u, k) => (k - 1 === filled ? `${mark(u, k)} content-box` : 'transparent')}};
}

function axis(label, more) {
  return {
    label, stroke: () => css('ink'), grid: {stroke: () => css('grid'), width: 1},
    ticks: {stroke: () => css('grid'), width: 1}, labelSize: 22, size: more?.side ? 62 : 34,
    // Of whatever size, at least two numbers: steps are at most twice as wide as this.
    space: (u, side, low, high, size) => Math.min(more?.side ? 30 : 50, size / 4),
    font: '12px system-ui', labelFont: '12px system-ui', ...more,
  };
}

// At least so much of both sides of the middle: what is at rest else fills a plot with its rounding.
function room(least) {
  return (u, low, high) => {
    if (low == null || !isFinite(low)) return [-least, least];
    const middle = (low + high) / 2, half = Math.max((high - low) * 0.55, least);
    return [middle - half, middle + half];
  };
}

const plots = new Map();
// Of the places of plots, as they are told: to ask for one lays out the page, forty times a second.
const widths = new Map();

// A plot in a place, with options as `make` has them, made anew where `made` is another than before;
// `more` is kept at the plot, for what is drawn by hand.
function plot(id, made, make, data, more = {}) {
  const place = document.getElementById(id), width = widths.get(id) ?? place.clientWidth;
  if (!width) return null;
  let u = plots.get(id);
  if (u?.made === made) {
    Object.assign(u, more);
    if (data) u.setData(data); else u.redraw(false);
    return u;
  }
  u?.destroy();
  const keep = {hooks: {init: [u => Object.assign(u, more, {made})]}};
  const options = make();
  keep.hooks = {...options.hooks, ...keep.hooks};
  u = new uPlot({width, cursor: {show: false}, ...options, ...keep}, data, place);
  u.root.setAttribute('role', 'img');
  plots.set(id, u);
  return u;
}

function describe(id, text) {
  plots.get(id)?.root.setAttribute('aria-label', text);
}

const resizing = new ResizeObserver(entries => {
  for (const {target} of entries) {
    const u = plots.get(target.id), width = target.clientWidth;
    widths.set(target.id, width);
    if (u && width && u.width !== width) u.setSize({width, height: u.height});
  }
});
document.querySelectorAll('.plot').forEach(place => resizing.observe(place));
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
  colours.clear();
  for (const u of plots.values()) u.redraw();
});

// Bands over time from the smallest to the largest value of each stretch: lines that joined these in
// turn would look like waves. `values` has the smallest of SIGNALS, then the largest.
function drawSignals(id, what, times, values, height, onSelect) {
  const factor = what === 'displacement' ? MICRO : MILLI;
  const unit = what === 'displacement' ? 'µm' : 'mm/s';
  const line = (label, colour, more) => ({label, stroke: () => css(colour), width: 1, points: {show: false}, ...more});
  const band = (low, colour) => ({series: [low + 2, low], fill: () => `${css(colour)}80`});
  const [tool, workpiece, mostTool, mostWorkpiece] = [0, 2, 4, 6].map(s => values[s + (what === 'velocity')]);
  const u = plot(id, height, () => ({
    height, legend: legend(['tool', 'workpiece', 'tool', 'workpiece']),
    series: [{}, line('tool', 'tool'), line('workpiece', 'workpiece'), line('tool', 'tool', {class: 'most'}), line('workpiece', 'workpiece', {class: 'most'})],
    bands: [band(1, 'tool'), band(2, 'workpiece')],
    scales: {x: {time: false}, y: {range: room(factor * (what === 'displacement' ? 1e-8 : 1e-5))}},
    axes: [axis('simulated time / s'), axis(height < 150 ? unit : `${what} / ${unit.includes('/') ? `(${unit})` : unit}`, {side: 3})],
    cursor: {show: !!onSelect, drag: {x: true, y: false, setScale: false}},
    hooks: onSelect ? {draw: [u => u.mark?.(u)], setSelect: [u => {
      if (u.select.width > 4) {
        onSelect(u.posToVal(u.select.left, 'x'), u.posToVal(u.select.left + u.select.width, 'x'));
        u.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
      }
    }]} : {},
  }), [times, tool, workpiece, mostTool, mostWorkpiece]);
  if (!u) return;
  const range = (low, high) => {
    const known = [low, high].map(column => column.filter(v => v != null));
    return known[0].length ? `${near(Math.min(...known[0]))} to ${near(Math.max(...known[1]))}` : 'unknown';
  };
  const now = performance.now();
  if (!(now - u.described < 2000)) {
    u.described = now;
    const span = times.length ? `from ${number(times[0])} to ${number(times[times.length - 1])} s` : '';
    describe(id, `${what} ${span}: tool ${range(tool, mostTool)}, workpiece ${range(workpiece, mostWorkpiece)} ${unit}`);
  }
}

const plain = new Intl.NumberFormat('en', {maximumFractionDigits: 9, useGrouping: false});

function number(value, digits = 3) {
  return value == null || !isFinite(value) ? '–' : plain.format(Number(value.toPrecision(digits)));
}

// A number in µm or mm/s to be read: what is at rest has no digits.
const near = value => number(Math.abs(value) < 1e-3 ? 0 : value);

// Axes for what is drawn by hand over them.
// Five to six decades, from a power of ten: uPlot divides an axis from 9.6e-12 without end, and one
// whose end is not finite too; a usual range while nothing is known.
function logarithmic(high) {
  const top = Number.isFinite(high) && high > 1e-6 ? high * 2 : 1e-3;
  return [Number(`1e${Math.floor(Math.log10(top)) - 5}`), top];
}

function canvas(id, axes, ranges, hand) {
  plot(id, id, () => ({
    height: 210, axes, legend: {show: false},
    scales: {x: {time: false, range: u => u.ranges[0]}, y: {range: u => u.ranges[1]}},
    series: [{}, {points: {show: false}}],
    hooks: {draw: [u => u.hand(u)]},
  }), [ranges[0], [null, null]], {ranges, hand});
}

function extent(values, least) {
  let low = Infinity, high = -Infinity;
  for (const v of values) {
    if (v < low) low = v;
    if (v > high) high = v;
  }
  return room(least)(null, low, high);
}

function drawPortrait(id, body, line, points) {
  const n = line.length / 2;
  if (!n) return;
  const x = line.subarray(0, n).map(v => v * MICRO), y = line.subarray(n).map(v => v * MILLI);
  const axes = [axis(`${body} / µm`), axis('velocity / (mm/s)', {side: 3, size: 54})];
  canvas(id, axes, [extent(x, 0.01), extent(y, 0.01)], u => {
    const {ctx} = u, to = (v, scale) => u.valToPos(v, scale, true);
    clip(u);
    ctx.strokeStyle = css(body);
    ctx.lineWidth = devicePixelRatio;
    ctx.beginPath();
    for (let k = 0; k < n; k++) ctx.lineTo(to(x[k], 'x'), to(y[k], 'y'));
    ctx.stroke();
    ctx.fillStyle = css('ink');
    for (let k = 0; k < points.length / 2; k++) {
      dot(ctx, to(points[k] * MICRO, 'x'), to(points[k + points.length / 2] * MILLI, 'y'), 2);
    }
    ctx.restore();
  });
  describe(id, `Phase portrait of the ${body}: ${near(Math.min(...x))} to ${near(Math.max(...x))} µm${points.length ? `, ${points.length / 2} turns` : ''}`);
}

// What was drawn of a cut that has begun anew, and of which nothing has come yet.
function wipePlots() {
  for (const id of plots.keys()) if (id !== 'chart') wipe(id);
}

function wipe(id) {
  const u = plots.get(id);
  if (!u) return;
  Object.assign(u, {hand: () => {}, turn: null, chatter: null, described: null});
  u.setData(u.data.map(() => []));
  describe(id, 'Nothing has come to be shown here.');
}

function clip(u) {
  u.ctx.save();
  u.ctx.beginPath();
  u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
  u.ctx.clip();
  u.ctx.setLineDash([]);
}

function dot(ctx, x, y, radius) {
  ctx.beginPath();
  ctx.arc(x, y, radius * devicePixelRatio, 0, 2 * Math.PI);
  ctx.fill();
}

function upright(u, x, colour, label, dash = []) {
  const at = u.valToPos(x, 'x', true), {ctx, bbox} = u;
  ctx.strokeStyle = ctx.fillStyle = css(colour);
  ctx.setLineDash(dash.map(v => v * devicePixelRatio));
  ctx.beginPath();
  ctx.moveTo(at, bbox.top);
  ctx.lineTo(at, bbox.top + bbox.height);
  ctx.stroke();
  ctx.setLineDash([]);
  if (!label) return;
  ctx.textAlign = 'left';
  ctx.font = `${12 * devicePixelRatio}px system-ui`;
  const left = at + 4 * devicePixelRatio, width = ctx.measureText(label).width;
  ctx.fillText(label, Math.min(left, bbox.left + bbox.width - width), bbox.top + 12 * devicePixelRatio);
}

// Amplitudes on a logarithmic scale, the harmonics of the spindle dotted, chatter by a line.
function drawSpectrum(amplitudes, step, speed, chatter, about = chatter) {
  const x = Float64Array.from(amplitudes, (_, k) => k * step);
  // To some times what is known to vibrate, in steps, so that it is still.
  const all = x[x.length - 1], most = about ? Math.min(all, 500 * Math.ceil(about / 100)) : plots.get('spectrum')?.most ?? all;
  const y = Array.from(amplitudes, v => Math.max(v * MICRO, 1e-7));
  plot('spectrum', 'spectrum', () => ({
    height: 220, legend: {show: false},
    scales: {x: {time: false, range: u => [0, u.most]}, y: {distr: 3, range: (u, low, high) => logarithmic(high)}},
    axes: [axis('frequency / Hz'), axis('amplitude / µm', {side: 3, values: (u, list) => list.map(v => (v && Number.isInteger(Math.log10(v)) ? v.toExponential(0) : ''))})],
    series: [{}, {stroke: () => css('tool'), width: 1, points: {show: false}}],
    hooks: {draw: [u => {
      clip(u);
      u.ctx.lineWidth = devicePixelRatio;
      for (let k = 1; u.turn && k <= 20; k++) upright(u, k * u.turn, 'line', '', [1, 4]);
      if (u.chatter) upright(u, u.chatter, 'alarm', `${u.chatter.toFixed(1)} Hz`);
      u.ctx.restore();
    }]},
  }), [x, y], {turn: speed / 60, chatter, most});
  let peak = 1;
  amplitudes.forEach((v, k) => { if (k && v > amplitudes[peak]) peak = k; });
  describe('spectrum', `Spectrum of the tool: largest ${near(amplitudes[peak] * MICRO)} µm at ${number(peak * step)} Hz${chatter ? `, chatter at ${number(chatter)} Hz` : ''}`);
}

const LIMITS = [
  ['depth_of_cut', 'every smaller depth is stable', 'safe', [], 'none seated gap both_sides'],
  ['open_limit', 'limit, open', 'tool', [], 'none gap both_sides'],
  ['seated_limit', 'limit, on its bearing', 'workpiece', [8, 4], 'seated gap both_sides'],
  ['seating_line', 'here the force closes the clearance', 'ink', [2, 3], 'gap both_sides'],
  ['stable_95%', 'stable with 95 %', 'safe', [6, 2], ''],
  ['stable_50%', '50 %', 'safe', [4, 4], ''],
  ['stable_5%', '5 %', 'safe', [2, 6], ''],
];

// The chart with the operating point {speed, depth}, its trail, and the recommended speed.
function drawChart(chart, point, trail, recommended, alarmed) {
  const shown = LIMITS.filter(([name, , , , contacts]) =>
    chart[name]?.some(v => v != null) && (!contacts || contacts.split(' ').includes(chart.contact)));
  // With the pockets as far up as a slider goes, where the machine is not so soft that they are small then.
  const top = Math.max(Math.min(1.5 * chart.top, 2e-3), chart.top, (point?.depth ?? 0) * 1.25) * MILLI;
  const same = plots.get('chart')?.made === chart && plots.get('chart').top === top;
  const data = same ? null : [chart.speed, ...shown.map(([name]) =>
    chart[name].map(v => (v == null ? 10 * top : Math.min(v * MILLI, 10 * top))))];
  plot('chart', chart, () => ({
    height: 320, legend: legend(shown.map(([, , colour]) => colour), shown.map(([, , , dash]) => dash), shown.findIndex(([name]) => name === 'depth_of_cut')),
    scales: {x: {time: false, range: () => [chart.speed[0], chart.speed[chart.speed.length - 1]]},
      y: {range: u => [0, u.top]}},
    axes: [axis('spindle speed / (rev/min)'), axis('depth of cut / mm', {side: 3})],
    series: [{}, ...shown.map(([name, label, colour, dash]) => ({
      label, dash, stroke: () => css(colour), width: name === 'depth_of_cut' ? 0 : 1.5, points: {show: false},
      fill: name === 'depth_of_cut' ? () => `${css(colour)}30` : undefined,
    }))],
    hooks: {draw: [u => u.hand(u)]},
  }), data, {top, hand: u => {
    const {ctx} = u, to = p => [u.valToPos(p.speed, 'x', true), u.valToPos(p.depth * MILLI, 'y', true)];
    clip(u);
    ctx.lineWidth = 1.5 * devicePixelRatio;
    if (recommended) upright(u, recommended, 'safe', `${Math.round(recommended)}`, [6, 3]);
    ctx.strokeStyle = css('soft');
    ctx.beginPath();
    for (const p of trail) ctx.lineTo(...to(p));
    if (point) ctx.lineTo(...to(point));
    ctx.stroke();
    ctx.fillStyle = css('soft');
    for (const p of trail) dot(ctx, ...to(p), 2);
    if (point) {
      ctx.fillStyle = css(alarmed ? 'alarm' : 'paper');
      ctx.strokeStyle = css('ink');
      ctx.lineWidth = 2.5 * devicePixelRatio;
      dot(ctx, ...to(point), 7);
      ctx.stroke();
    }
    ctx.restore();
  }});
}
