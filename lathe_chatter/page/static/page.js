// The operator's page: what comes from the server is shown, what the operator wishes is sent to it.
'use strict';

const $ = id => document.getElementById(id);
const COUNT = 1000, WINDOWS = [2, 60], PATIENCE = 3000, NO_ANSWER = 'The server of this page does not answer.';
// Units of the shop floor: of a parameter by name, else by its SI unit; and where a slider ends.
const SHOP = {
  spindle_speed_rpm: ['rev/min', 1, 12000], depth_of_cut: ['mm', 1e3, 2], bearing_clearance: ['µm', 1e6, 20],
  feed_speed: ['mm/s', 1e3, 10], feed_per_revolution: ['mm/rev', 1e3, 0.5], workpiece_diameter: ['mm', 1e3, 200],
  runout: ['µm', 1e6, 20], tool_runout: ['µm', 1e6, 20], sensor_noise: ['µm', 1e6, 1], real_time_factor: ['', 1, 5],
  force_noise: ['N/√Hz', 1, 1], cutting_force_noise: ['N/√Hz', 1, 1], acceleration_noise: ['m/s²', 1, 10],
  speed_variation_amplitude: ['%', 100, 50], speed_variation_frequency: ['Hz', 1, 10], unbalance: ['g mm', 1e6, 5000],
};
const PRIMARY = ['spindle_speed_rpm', 'depth_of_cut', 'bearing_clearance', 'bearing_contact', 'feed_speed', 'feed_per_revolution'];

let socket = null, retries = 0, asked = 0, frames = 0;
// Why nothing comes from the server, in words; and when the frame that was asked for is overdue.
let unanswered = '', overdue = Infinity;
const waiting = new Map();
let cell, page, server, trail, signals, envelopes, recommended, recorded = false, figuresDue = false, operated = false;

function forget() {
  cell = {};
  trail = [];
  signals = null;
  envelopes = noEnvelopes();
}

// Of each signal the smallest values, then of each the largest.
function noEnvelopes() {
  return WINDOWS.map(() => ({next: 0, times: [], values: [...SIGNALS, ...SIGNALS].map(() => [])}));
}

const worded = name => name.replace(/_rpm$/, '').replaceAll('_', ' ');

// A sentence of a node as an operator reads it: with his words, units and signs.
function plainly(text) {
  const changed = (all, name, from, to) => {
    const [unit, factor] = SHOP[name] ?? [];
    return factor ? `${worded(name)} from ${number(from * factor, 5)} to ${number(to * factor, 5)} ${unit}`.trim() : all;
  };
  return text.replace(/\b(\w+) from ([-\d.e]+) to ([-\d.e]+)/g, changed).replace('~/accept does it', 'press Accept')
    .replace(/\bum\b/g, 'µm').replaceAll('+-', '±').replaceAll(' 1/s', ' /s');
}

// ---- connection ------------------------------------------------------------------------------

function connect() {
  operated ||= !!server?.operating;
  forget();
  page = {};
  server = {};
  waiting.forEach(done => done({ok: false, text: 'The connection was lost before an answer came.'}));
  waiting.clear();
  socket = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/feed`);
  socket.binaryType = 'arraybuffer';
  socket.onopen = () => {
    retries = 0;
    const token = sessionStorage.getItem('token');
    if (token) ask({do: 'token', token}).then(answer => { if (!answer.ok) notify(answer); });
    if (operated) notify({ok: false, text: 'The connection was lost: you are looking on.'});
    operated = false;
    wish({do: 'next'});
  };
  socket.onmessage = message => {
    overdue = Infinity;
    if (unanswered) tell('');
    const length = new DataView(message.data).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(message.data, 4, length)));
    const arrays = {};
    let start = 4 + length;
    for (const [name, size] of header.arrays) {
      arrays[name] = new Float32Array(message.data, start, size);
      start += 4 * size;
    }
    // Not before this one is drawn: a page that nobody sees asks for nothing.
    requestAnimationFrame(() => wish({do: 'next'}));
    take(header, arrays);
  };
  socket.onclose = event => {
    const wait = Math.min(5, 0.5 * 2 ** retries++);
    overdue = Infinity;
    tell(`${event.reason || NO_ANSWER} What you see is old. Trying again (${retries}) ...`);
    setTimeout(connect, wait * 1000);
  };
}

// Whether the server answers, and all that holds only while it does.
function tell(why) {
  unanswered = why;
  takeServer({});
  showQuestion();
  showAlive();
}

// A server that stands still closes nothing.
setInterval(() => { if (!unanswered && performance.now() > overdue) tell(`${NO_ANSWER} What you see is old.`); }, 500);

function wish(message) {
  if (socket.readyState !== WebSocket.OPEN) return;
  if (message.do === 'next') overdue = performance.now() + PATIENCE;
  socket.send(JSON.stringify(message));
}

function ask(message) {
  return new Promise(done => {
    if (socket.readyState !== WebSocket.OPEN) return done({ok: false, text: NO_ANSWER});
    waiting.set(++asked, done);
    wish({...message, id: asked});
  });
}

function notify({ok, text}) {
  if (!text) return;
  $('notice').textContent = plainly(text);
  $('notice').hidden = false;
  $('notice').classList.toggle('bad', !ok);
  clearTimeout(notify.timer);
  notify.timer = setTimeout(() => { $('notice').hidden = true; }, ok ? 4000 : 12000);
}

const act = message => ask(message).then(answer => (notify(answer), answer));

// ---- what comes ------------------------------------------------------------------------------

function take(header, arrays) {
  frames += 1;
  for (const answer of header.answers ?? []) {
    const done = waiting.get(answer.id);
    waiting.delete(answer.id);
    if (done) done(answer); else notify(answer);
  }
  if (header.page) takePage(header.page);
  if (header.server) takeServer(header.server);
  if (header.view) takeView(header.view, arrays);
  if (header.cell) takeCell(header.cell);
  if (figuresDue && (recorded || frames % 5 === 0)) showFigures();  // nobody reads 20 a second
  if (header.signals) takeSignals(header.signals, arrays);
  if (header.closeup) takeCloseup(header.closeup, arrays);
}

function takePage(news) {
  Object.assign(page, news);
  recorded = !!page.recorded;
  document.body.classList.toggle('is-recorded', recorded);
  if (news.lathes) {
    const before = $('lathes').value || sessionStorage.getItem('lathe');
    $('lathes').replaceChildren(...news.lathes.map(name => new Option(name)));
    if (news.lathes.includes(before)) $('lathes').value = before;
    if (news.lathes.length && (!cell.name || cell.name !== $('lathes').value)) choose();
    else if (!news.lathes.length) showAlive();
  }
  if (recorded) takeRun(news);
  if ('other_pages' in news) takeServer({});
  if ('begun' in news) showLog();
  if (news.scenarios) {
    $('scenario').replaceChildren(...Object.keys(news.scenarios).map(name => new Option(worded(name), name)));
    describeScenario();
  }
}

function choose() {
  forget();
  // What the one before had, this one may not have, and then says nothing of.
  makeSupervisor(null);
  showLog();
  showQuestion();
  showScenario({text: ''});
  for (const id of ['recording', 'health', 'chart-text']) $(id).textContent = '';
  sessionStorage.setItem('lathe', $('lathes').value);
  act({do: 'choose', lathe: $('lathes').value});
}

function takeServer(news) {
  Object.assign(server, news);
  const free = !server.operator;
  $('operate').textContent = server.operating ? 'Look on' : free ? 'Operate' : 'Take over';
  $('operate').setAttribute('aria-pressed', String(!!server.operating && !unanswered));
  $('operate').disabled = !server.trusted || !!unanswered;
  document.body.classList.toggle('looking-on', !server.operating);
  lock();
  if (unanswered || !('viewers' in server)) return void ($('viewers').textContent = '');
  if (recorded) return;
  const others = page.other_pages > 0 ? ' Another operator page serves this ROS domain too, or did so until just now: who operates there is not known here.' : '';
  const who = server.operating ? 'you operate' : free ? 'nobody operates' : `${server.operator} operates`;
  $('viewers').textContent = `${server.viewers} ${server.viewers === 1 ? 'viewer' : 'viewers'}, ${who}. You are ${server.you}${server.trusted ? '' : ', without the token: you may look, and not act'}.${others}`;
}

// What may be pressed now, and what not.
function lock() {
  if (recorded) return;
  const mine = server.operating && !unanswered;
  document.querySelectorAll('.act').forEach(each => { each.disabled = !mine; });
  recommended = heard() ? cell.figures?.recommended_speed_rpm : null;
  $('snapshot').disabled ||= !!cell.statuses?.recorder?.recording?.values?.run;
  $('take-recommended').disabled = !mine || !recommended;
  $('take-recommended').textContent = recommended ? `Set ${Math.round(recommended)} rev/min` : 'No speed is recommended';
}

function takeCell(news) {
  Object.assign(cell, news);
  const shown = {
    lathe_rows: makeControls, lathe_values: showValues, supervisor_rows: makeSupervisor,
    supervisor_values: values => { if (document.activeElement !== $('mode')) $('mode').value = values.mode; },
    action: showQuestion, asked: showQuestion, figures: () => { figuresDue = true; }, flag: showLamp, state: showLamp,
    alive: showAlive, statuses: showAlive, log: showLog, chart: showChart, charting: showChart,
    scenario: showScenario,
  };
  for (const name of Object.keys(news)) shown[name]?.(news[name]);
}

function showQuestion() {
  // Without an offer that still stands, only what the supervisor would do.
  $('action').textContent = plainly(cell.action ?? '').replace(cell.asked ? '' : ': press Accept', '');
  $('question-text').textContent = cell.asked ? `The supervisor asks. ${$('action').textContent}` : '';
  $('question').hidden = !cell.asked || !!unanswered;
}

// Of the run, as the lathe tells it: running, paused or ended.
const state = () => cell.statuses?.lathe?.pace?.values?.state;

// Why what is seen holds no more, in words; none where it holds.
function stale() {
  if (recorded) return '';
  if (unanswered) return 'What you see is old.';
  const {lathe, samples} = cell.alive ?? {samples: true};
  if (samples || (lathe && state() === 'paused')) return '';
  return lathe && state() === 'ended' ? 'The cut has ended.' : 'What you see is old.';
}

// Whether the monitor speaks, and of what is seen.
const heard = () => !stale() && (recorded || !!cell.alive?.monitor);

// What is amiss with the cell, in words.
function amiss() {
  if (recorded) return '';
  if (!cell.alive) return page.lathes?.length === 0 ? 'No lathe has been found. The page waits for one.' : '';
  const {lathe, monitor, recorder, samples} = cell.alive;
  const run = state(), {pace} = cell.statuses?.lathe ?? {}, words = [];
  if (!lathe && !samples) words.push(`${cell.name} is silent. What you see is old; the page goes on when it is back.`);
  else if (!samples && !['paused', 'ended'].includes(run)) words.push(`No samples come from ${cell.name}${pace?.level ? `: ${pace.message}` : ''}.`);
  else if (run === 'ended') words.push(`${cell.statuses.lathe.cut?.message ?? 'The cut has ended.'} Reset begins anew.`);
  if (!monitor) words.push('The monitor is silent: nothing is known of chatter.');
  if (!recorder) words.push('No recorder speaks.');
  const told = cell.statuses?.monitor?.samples;
  for (const text of [cell.complaint, monitor && told?.level > 1 && run !== 'paused' ? told.message : '']) if (text) words.push(text);
  return plainly(words.join(' '));
}

function showAlive() {
  $('gone').textContent = unanswered || amiss();
  $('gone').hidden = !$('gone').textContent;
  showLamp();
  showStatuses();
}

// Since when the flag is as it is, s, where that is told.
function flagSince() {
  const told = cell.statuses?.monitor?.cut?.values ?? {}, same = told.flag === (cell.flag?.up ? 'True' : 'False');
  return cell.flag?.since ?? (same ? told['flag since, s'] : null);
}

// Whether chatter is flagged in what is seen; null where that is not known.
function flagged() {
  const now = recorded ? Infinity : signals?.time, up = cell.flag?.up;
  // Not of a run before this one: nothing was cut in this, or the flag is of a time to come.
  const other = signals && (now == null || (up && flagSince() > now + 0.5));
  return cell.flag && !other && heard() ? up : null;
}

function showLamp() {
  const up = flagged(), at = flagSince();
  $('lamp').className = `lamp ${up ? 'up' : up == null || cell.state === 'unknown' ? '' : 'down'}`;
  const word = up == null ? (run.reading ? 'reading' : 'unknown') : up ? 'CHATTER' : cell.state ?? 'no chatter';
  if ($('lamp-word').textContent !== word) $('lamp-word').textContent = word;
  const since = up && at != null ? `since ${Number(at).toFixed(2)} s` : '';
  if ($('lamp-since').textContent !== since) $('lamp-since').textContent = since;
}

function showFigures() {
  figuresDue = false;
  const f = (heard() && cell.figures) || {}, cut = cell.statuses?.monitor?.cut?.values ?? {};
  const error = key => (cut[key] == null || isNaN(cut[key]) ? '' : ` ± ${number(Number(cut[key]), 2)}`);
  const margin = cut['standard error of the margin'];
  const texts = {
    growth_rate: f.growth_rate == null ? '–' : `${number(f.growth_rate)}${error('standard error of the growth rate, 1/s')} /s`,
    frequency: f.frequency == null ? '–' : `${f.frequency.toFixed(1)} Hz`,
    amplitude: f.amplitude == null ? '–' : `${f.amplitude < 1e-9 ? '< 0.001' : number(f.amplitude * MICRO)} µm`,
    margin: f.margin == null || flagged() !== false ? '–' : `${(f.margin * 100).toFixed(0)}${margin == null || isNaN(margin) ? '' : ` ± ${(margin * 100).toFixed(0)}`} %`,
    recommended: f.recommended_speed_rpm == null ? '–' : `${Math.round(f.recommended_speed_rpm)} rev/min`,
  };
  for (const [id, text] of Object.entries(texts)) if ($(id).textContent !== text) $(id).textContent = text;
  lock();
}

function showStatuses() {
  const {lathe, monitor, recorder} = cell.statuses ?? {}, pace = lathe?.pace, v = pace?.values ?? {};
  const paused = state() === 'paused';
  const button = document.querySelector('[data-call=pause], [data-call=resume]');
  button.dataset.call = paused ? 'resume' : 'pause';
  button.textContent = paused ? 'Go on' : 'Pause';
  if (!recorded) showClock();
  const lost = [
    [Number(monitor?.samples?.values?.['samples lost'] ?? 0), 'the monitor'],
    [Number(recorder?.recording?.values?.lost ?? 0), 'the recorder'], [signals?.lost ?? 0, 'this page'],
  ].filter(([count]) => count).map(([count, who]) => `${count} by ${who}`), old = stale();
  $('health').className = (pace?.level ?? 0) || lost.length ? 'bad' : '';
  $('health').textContent = old ? `${old}${lost.length ? ` Lost: ${lost.join(', ')}.` : ''}` : pace ? `${pace.message}: ${number(Number(v['real-time factor']))} × real time, late by ${number(Number(v['lateness p99, us']) / 1e3)} ms (p99), ${number(Number(v['lag given up, s']))} s given up. Lost: ${lost.join(', ') || 'nothing'}.` : '';
  const recording = recorder?.recording;
  $('recording').textContent = unanswered ? 'Not known while the server of this page does not answer.' : cell.alive?.recorder === false ? 'No recorder speaks.' : recording ? `${recording.message}${recording.values.run ? `. ${recording.values.messages} messages went into ${recording.values.run}.` : ''}` : 'No recorder has spoken.';
  showFigures();
}

function showLog() {
  const items = [...(cell.log ?? [])].reverse().map(entry => {
    const item = document.createElement('li'), who = document.createElement('span');
    who.className = 'who';
    who.textContent = `${entry.node.split('/').pop()}: `;
    item.className = entry.level >= 40 ? 'error' : entry.level >= 30 ? 'warn' : '';
    item.append(who, plainly(entry.text));
    return item;
  });
  const begun = document.createElement('li');
  begun.textContent = `This page began at ${page.begun} and lists the newest: what is older is in the record, where one was kept.`;
  $('log').replaceChildren(...items, begun);
}

function showScenario({playing, text, before}) {
  $('scenario-text').textContent = plainly(text);
  $('play').textContent = playing ? 'Stop' : 'Play';
  $('back').hidden = playing || !before;
}

function describeScenario() {
  if (!cell.scenario?.playing) $('scenario-text').textContent = page.scenarios[$('scenario').value];
}

function takeSignals(news, arrays) {
  if (signals && signals.epoch !== news.epoch) {
    envelopes = noEnvelopes();
    trail = [];
    document.querySelectorAll('.refusal').forEach(each => { each.textContent = ''; });
    signals = news;
    showLamp();
    if (news.time == null) wipePlots();
  }
  signals = news;
  news.spans.forEach(([first, count, step], k) => {
    const e = envelopes[k], values = arrays[`envelope_${k}`], width = SIGNALS.length;
    const missed = e.times.length ? Math.min(first - e.next, COUNT) : 0;
    const add = (at, of) => {
      e.times.push((at + 0.5) * step);
      e.values.forEach((list, s) => list.push(of(s)));
    };
    for (let m = missed; m > 0; m--) add(first - m, () => null);
    for (let m = 0; m < count; m++) {
      add(first + m, s => {
        const v = values[((s < width ? 0 : count) + m) * width + s % width];
        return Number.isNaN(v) ? null : v * (s % 2 ? MILLI : MICRO);
      });
    }
    e.next = first + count;
    const old = e.times.length - COUNT;
    if (old > 0) for (const list of [e.times, ...e.values]) list.splice(0, old);
    if (count && (k === 0 || frames % 10 === 0)) drawEnvelope(k);
  });
  if (frames % 4 === 0 || news.time == null) showClock();
}

function showClock() {
  const pause = state() === 'paused' && !stale() ? ', paused' : '';
  if (signals) $('clock').textContent = `${(signals.time ?? 0).toFixed(1)} s${pause}`;
}

function drawEnvelope(k, height = k ? 130 : 170, onSelect = null) {
  const {times, values} = envelopes[k];
  drawSignals(`displacement-${k}`, 'displacement', times, values, height, onSelect);
  drawSignals(`velocity-${k}`, 'velocity', times, values, height, onSelect);
}

function takeCloseup(figures, arrays) {
  const chatter = flagged() ? cell.figures?.frequency : null;
  for (const body of ['tool', 'workpiece']) {
    if (arrays[`${body}_portrait`]) drawPortrait(`${body}-portrait`, body, arrays[`${body}_portrait`], arrays[`${body}_turns`] ?? []);
    else wipe(`${body}-portrait`);
  }
  if (arrays.spectrum) drawSpectrum(arrays.spectrum, figures.hertz, figures.speed, chatter, cell.figures?.frequency);
  else wipe('spectrum');
  const depth = figures.depth ?? cell.lathe_values?.depth_of_cut;
  const speed = figures.speed ?? cell.lathe_values?.spindle_speed_rpm;
  if (depth == null) return;
  const last = trail[trail.length - 1];
  if (!recorded && (!last || Math.abs(last.speed - speed) > 5 || Math.abs(last.depth - depth) > 1e-6)) {
    trail.push({speed, depth});
    if (trail.length > 60) trail.shift();
  }
  cell.point = {speed, depth};
  showChart();
}

function showChart() {
  const {chart, point} = cell;
  if (!chart || chart.error) {
    $('chart-text').textContent = chart?.error ?? (cell.charting ? 'The chart is being computed ...' : '');
    return;
  }
  drawChart(chart, point, trail, recommended, flagged());
  const k = point ? chart.speed.findIndex(speed => speed >= point.speed) : -1;
  const share = k > 0 ? (point.speed - chart.speed[k - 1]) / (chart.speed[k] - chart.speed[k - 1]) : 1;
  const limit = name => {
    const [low, high] = [chart[name][Math.max(k - 1, 0)], chart[name][k]];
    return low == null || high == null ? 'none' : `${number((low + share * (high - low)) * MILLI)} mm`;
  };
  const text = k < 0 ? '' : `The cut: ${point.speed.toFixed(0)} rev/min, ${(point.depth * MILLI).toFixed(3)} mm. Limits there: ${limit('depth_of_cut')}, below which every depth is stable to small disturbances; open ${limit('open_limit')}${chart.contact === 'none' ? '' : `, on its bearing ${limit('seated_limit')}`}.${cell.charting ? ' The chart is being computed anew ...' : ''}`;
  if ($('chart-text').textContent !== text) {
    $('chart-text').textContent = text;
    describe('chart', `Stability chart. ${text}`);
  }
}

// ---- what is done ----------------------------------------------------------------------------

// A number as people type it, with a point or a comma; what may be none is refused in words.
function typed(text) {
  const given = text.trim(), plain = given.replace(',', '.'), value = Number(plain);
  if (/^[-+]?[1-9]\d{0,2},\d{3}$/.test(given)) return {why: `${given} may be ${given.replace(',', '')} or ${plain}: write one of them. Nothing was changed.`};
  if (given && /^[-+.\de]+$/i.test(plain) && isFinite(value)) return {value};
  return {why: `${given ? `"${given.slice(0, 20)}" is not a number` : 'The field was empty'}: nothing was changed.`};
}

function shop(row) {
  const {name, unit, high} = row;
  if (SHOP[name]) return SHOP[name];
  if (unit === 'm') return high <= 1e-3 ? ['µm', 1e6, high * 1e6] : ['mm', 1e3, high * 1e3];
  if (unit === 'm/s') return ['mm/s', 1e3, high * 1e3];
  return [unit, 1, high];
}

function makeControls(rows) {
  const run = rows.filter(row => !row.fixed && (row.choices.length || row.type === 1 || row.low != null));
  const order = row => (PRIMARY.indexOf(row.name) + 1 || 99);
  for (const [id, wanted] of [['primary', true], ['secondary', false]]) {
    const mine = run.filter(row => PRIMARY.includes(row.name) === wanted).sort((a, b) => order(a) - order(b));
    $(id).replaceChildren(...mine.map(row => makeControl(row)));
  }
  $('fixed').replaceChildren(...rows.filter(row => row.fixed && !row.name.startsWith('qos_overrides')).flatMap(row => {
    const name = document.createElement('dt'), value = document.createElement('dd');
    name.textContent = row.name;
    value.dataset.fixed = row.name;
    value.dataset.unit = row.unit;
    return [name, value];
  }));
  if (cell.lathe_values) showValues();
  lock();
}

const controls = new Map();

function makeControl(row) {
  const [unit, factor, end] = shop(row), place = document.createElement('div'), id = `p-${row.name}`;
  place.className = 'control';
  const label = document.createElement('label'), line = document.createElement('div');
  label.htmlFor = id;
  label.textContent = worded(row.name) + (unit ? ` / ${/[/ ]/.test(unit) ? `(${unit})` : unit}` : '');
  line.className = 'row';
  const help = document.createElement('small'), refusal = document.createElement('span');
  help.id = `${id}-help`;
  const meaning = row.meaning;
  help.textContent = meaning.replace(/ \w+$/, '') === worded(row.name) || meaning === worded(row.name) ? '' : meaning;
  refusal.className = 'refusal';
  refusal.setAttribute('role', 'alert');
  const listed = row.choices.length || row.type === 1;
  const field = document.createElement(listed ? 'select' : 'input');
  if (listed) field.append(...(row.choices.length ? row.choices : ['true', 'false']).map(v => new Option(worded(v), v)));
  else field.inputMode = 'decimal';
  field.id = id;
  field.setAttribute('aria-describedby', help.id);
  const parts = [field];
  let slider = null;
  if (!listed) {
    // Steps of round numbers, from a multiple of them on: so a key reaches 3000.
    const ten = 10 ** Math.floor(Math.log10(end / 1000)), step = Number((ten * [5, 2, 1].find(n => n * ten <= end / 999)).toPrecision(1));
    slider = Object.assign(document.createElement('input'), {type: 'range', min: Math.ceil(row.low * factor / step) * step, max: end, step});
    slider.setAttribute('aria-label', `${label.textContent}, slider`);
    parts.unshift(slider);
  }
  parts.forEach(each => each.classList.add('act'));
  line.append(...parts);
  place.append(label, line, help, refusal);
  const control = {show, busy: false, next: null, typing: false};
  controls.set(row.name, control);

  function show(value, force) {
    const shown = typeof value === 'number' ? Number((value * factor).toPrecision(9)) : String(value);
    if (value == null || (!force && (control.busy || control.next != null))) return;
    if (force || !control.typing || field.disabled) field.value = shown;
    if (slider) {
      slider.max = shown > end ? shown * 1.5 : end;
      slide(shown);
    }
  }
  function slide(to) {
    slider.value = to;
    slider.setAttribute('aria-valuetext', `${to} ${unit}`);
  }
  // One request at a time, and then the newest: a slider that is drawn floods nobody.
  async function send(value) {
    control.next = value;
    refusal.textContent = '';
    if (control.busy) return;
    control.busy = true;
    let answer = {ok: true, text: ''}, last;
    while (control.next != null) {
      last = control.next;
      control.next = null;
      answer = await ask({do: 'set', node: 'lathe', values: {[row.name]: last}});
    }
    control.busy = false;
    const outside = last < row.low || last > row.high, onShop = n => number(n * factor, 9);
    const allowed = row.allowed.slice(0, row.allowed.length - row.unit.length).replace(/-?\d[\d.]*(e[-+]?\d+)?/g, onShop);
    const here = `${onShop(last)} ${unit}: it ${allowed.trim()} ${unit}`.trim() + '. Nothing was changed.';
    // Of what was typed since, there may be a refusal; and others may have set it meanwhile.
    if (answer.ok) return void setTimeout(() => show(cell.lathe_values?.[row.name]), 500);
    refusal.textContent = outside ? here : answer.text;
    if (cell.lathe_values) show(cell.lathe_values[row.name], true);
  }
  function enter() {
    const {value, why} = typed(field.value), wanted = control.typing;
    control.typing = false;
    refusal.textContent = why ?? '';
    if (why) return show(cell.lathe_values[row.name], true);
    slide(field.value = value);
    if (wanted) send(value / factor);
  }
  if (listed) {
    field.addEventListener('change', () => send(row.type === 1 ? field.value === 'true' : field.value));
    return place;
  }
  field.addEventListener('input', () => { control.typing = true; });
  // No `change` comes where the same is typed again, and the lathe may have another value meanwhile.
  field.addEventListener('keydown', event => { if (event.key === 'Enter') enter(); });
  for (const kind of ['change', 'blur']) field.addEventListener(kind, () => { if (control.typing) enter(); });
  slider.addEventListener('input', () => {
    field.value = Number(Number(slider.value).toPrecision(6));
    slide(field.value);
    send(field.value / factor);
  });
  return place;
}

function showValues() {
  for (const [name, control] of controls) {
    if (cell.lathe_values[name] != null) control.show(cell.lathe_values[name]);
  }
  document.querySelectorAll('[data-fixed]').forEach(each => {
    const value = cell.lathe_values[each.dataset.fixed];
    each.textContent = value == null ? '–' : `${typeof value === 'number' ? number(value, 6) : String(value).slice(0, 200) || 'empty'} ${each.dataset.unit}`;
  });
}

function makeSupervisor(rows) {
  const mode = rows?.find(row => row.name === 'mode');
  $('supervisor').hidden = !mode;
  if (mode) $('mode').replaceChildren(...mode.choices.map(name => new Option(name)));
  lock();
}

document.addEventListener('click', event => {
  const {call} = event.target.dataset ?? {};
  if (call) act({do: call});
});
$('operate').onclick = () => act(server.operating ? {do: 'release'} : {do: 'operate', take_over: !!server.operator});
$('take-recommended').onclick = () => act({do: 'set', node: 'lathe', values: {spindle_speed_rpm: Math.round(recommended)}});
$('knock').onclick = () => {
  const {value, why} = typed($('impulse').value);
  const far = Math.abs(value) > 1000 ? `${number(value, 9)} mN s: from here -1000 to 1000 mN s are allowed. Nothing was hit.` : why;
  if (far) notify({ok: false, text: `Knock: ${far.replace('changed', 'hit')}`});
  else act({do: 'knock', impulse: value / 1e3});
};
$('play').onclick = () => act(cell.scenario?.playing ? {do: 'stop_playing'} : {do: 'play', scenario: $('scenario').value});
$('scenario').onchange = describeScenario;
$('lathes').onchange = choose;
$('mode').onchange = () => act({do: 'set', node: 'supervisor', values: {mode: $('mode').value}}).then(answer => {
  if (!answer.ok) $('mode').value = cell.supervisor_values.mode;
});

const given = new URLSearchParams(location.hash.slice(1)).get('token');
if (given) {
  sessionStorage.setItem('token', given);
  history.replaceState(null, '', location.pathname);
}
addEventListener('load', connect);
