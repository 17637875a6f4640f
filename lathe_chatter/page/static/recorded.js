// A recorded run: the whole of it above, a part of it below, and what was at the moment chosen.
'use strict';

const SPANS = [0.01, 0.1, 1, 2, 10, 60, 600, 3600];
const run = {span: 2, reading: '', state: '', busy: false, again: false, path: []};

function takeRun(news) {
  if (news.run) {
    const {name, begin, end, state, version} = news.run;
    $('run-name').textContent = `Recorded run ${name}`;
    Object.assign($('at'), {min: begin, max: end});
    if (run.end == null) {
      $('span').replaceChildren(...SPANS.filter(s => s < end - begin).map(s => new Option(`${s} s`, s)), new Option('all', end - begin));
      run.span = Number($('span').value = String(SPANS.filter(s => s <= 2 && s < end - begin).pop() ?? end - begin));
    }
    // Who has not left the end stays there, wherever it is found to be.
    Object.assign(run, {at: run.at < run.end ? Math.min(run.at, end) : end, end});
    $('span').lastElementChild.value = end - begin;
    if (version !== run.version) {
      run.version = version;
      view('overview', begin, end).then(() => look(run.at));
    }
    run.state = state;
  }
  if ('reading' in news) run.reading = news.reading;
  $('run-state').textContent = `${run.reading} ${run.state}`.trim();
  if (run.reading) $('chart-text').textContent = 'Chart, lamp and what happened come when all is read.';
  else if ('reading' in news) $('chart-text').textContent = '';
  showLamp();
  if (news.path) run.path = news.path;
  if (news.events) {
    $('log').replaceChildren(...news.events.map(([time, text]) => {
      const item = document.createElement('li'), button = document.createElement('button');
      button.type = 'button';
      button.textContent = `${time.toFixed(3)} s: ${plainly(text)}`;
      button.onclick = () => look(time);
      item.append(button);
      return item;
    }));
  }
  if (news.reading === '') look(run.at);
}

function view(plot, from, to) {
  return ask({do: 'view', plot, from, to});
}

// One request at a time, and then the newest: a slider that is drawn does not wait for old pictures.
async function look(at, span = run.span) {
  Object.assign(run, {at, span});
  trail = run.path.filter(([time], k) => k === 0 || time <= at).map(([, speed, depth]) => ({speed, depth}));
  $('at').value = at;
  $('at').setAttribute('aria-valuetext', `${at.toFixed(2)} s`);
  plots.get('overview')?.redraw(false);
  $('at-text').value = `${run.reading ? 'about ' : ''}${at.toFixed(span < 0.2 ? 4 : 2)} s`;
  run.again = true;
  if (run.busy) return;
  run.busy = true;
  while (run.again) {
    run.again = false;
    const answers = await Promise.all([view('part', run.at - run.span, run.at), ask({do: 'at', time: run.at})]);
    answers.filter(({ok}) => !ok).forEach(notify);
  }
  run.busy = false;
}

function takeView({from, to, plot}, {times, values}) {
  const n = times.length, x = Array.from(times, t => from + t);
  const columns = [...SIGNALS, ...SIGNALS].map((_, s) =>
    x.map((_, k) => values[((s < 4 ? 0 : n) + k) * 4 + s % 4] * (s % 2 ? MILLI : MICRO)));
  const select = (begin, end) => look(end, end - begin);
  if (plot === 'overview') {
    drawSignals('overview', 'displacement', x, columns, 130, select);
    Object.assign(plots.get('overview') ?? {}, {mark: markMoment}).redraw?.(false);
    return;
  }
  drawSignals('displacement-0', 'displacement', x, columns, 220, select);
  drawSignals('velocity-0', 'velocity', x, columns, 220, select);
  $('clock').textContent = run.reading ? '' : `${to.toFixed(3)} s`;
}

// The moment in the overview; and its slider, as wide as the axis above it.
function markMoment(u) {
  clip(u);
  u.ctx.lineWidth = 2 * devicePixelRatio;
  upright(u, run.at, 'ink', '');
  u.ctx.restore();
  const {left, width} = u.bbox, half = 8;
  $('at').style.marginLeft = `${left / devicePixelRatio - half}px`;
  $('at').style.width = `${width / devicePixelRatio + 2 * half}px`;
}

$('at').oninput = () => look(Number($('at').value));
$('span').onchange = () => look(run.at, Number($('span').value));
