//! The forms of the covariance, n = 6 … 300: prediction, update, and dense products for comparison.
//!
//! `form/predict/sparse`  Φ as of an inertial filter: 60 % of the states read a dozen others, noise on
//!                        all of them; the other states stand still
//! `form/predict/full`    Φ without a zero, noise on all states
//! `form/update`          three rows on six states each, of uncorrelated noise, and the test whether P is positive
//!                        afterwards, as in a filter; in the column of `faer` one dense QR of the array
//! `form/product`         ΦPΦᵀ as two dense products
//!
//! Before anything is timed, every form must give the result of Joseph's form. The table at the end, of least times
//! in interleaved runs, is the table in `backends-measured.md` of the book. On a busy machine its ratios are more
//! reliable than its times.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

#[path = "measure/once.rs"]
mod once;

use comfy_table::Table;
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use faer::Mat;
use fusion::core::covariance::{Form, FormKind, SquareRoot, Workspace, cholesky};
use fusion::core::linear::{Jacobian, Transition};
use fusion::core::state::{Declaration, Dynamics, Layout, LayoutBuilder, Quantity, Scalar, Slot, StateRole};
use fusion::core::testing::Lcg;
use nalgebra::{DMatrix, Matrix1};
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

const SIZES: [usize; 6] = [6, 15, 21, 60, 150, 300];
const ROWS: usize = 3;

fn forms() -> [(&'static str, Arc<dyn Form>); 4] {
    [
        ("joseph", FormKind::Joseph.form()),
        ("udu", FormKind::Udu.form()),
        ("square_root", Arc::new(SquareRoot { faer_from: usize::MAX })),
        ("square_root, faer", Arc::new(SquareRoot { faer_from: 0 })),
    ]
}

fn layout(n: usize) -> (Layout, Vec<Slot<Scalar>>) {
    let mut builder = LayoutBuilder::new();
    let mut declare = |i: usize| {
        builder.declare::<Scalar>(Declaration {
            name: format!("x{i}"),
            owner: String::new(),
            unit: "",
            initial: 0.0,
            sigma: vec![1.0],
            dynamics: Dynamics::Constant,
            role: StateRole::Kinematic,
        })
    };
    let slots = (0..n).map(|i| declare(i).unwrap()).collect();
    (builder.finish(), slots)
}

/// One size: Φ and Q, H and R, and a P that both have formed.
struct Problem {
    n: usize,
    sparse: Transition,
    full: Transition,
    jacobian: Jacobian,
    noise: [f64; ROWS * ROWS],
    start: Vec<f64>,
}

impl Problem {
    fn new(n: usize) -> Self {
        let (layout, slots) = layout(n);
        let mut random = Lcg::new(n as u64);
        let (mut sparse, mut full) = (Transition::new(&layout), Transition::new(&layout));
        for i in 0..n {
            for j in 0..n {
                let own = if i == j { 1.0 } else { 0.0 };
                // Four blocks of three: its own, the two after it, and one of those that stand still.
                let near = (0..9).contains(&((j + n - i / 3 * 3) % n)) || j / 3 == (i / 3 + 3 * n / 5) % n / 3;
                let value = own + 0.05 * random.signed() / (n as f64).sqrt();
                full.set(slots[i], slots[j], &Matrix1::new(value));
                if i < 3 * n / 5 && near {
                    sparse.set(slots[i], slots[j], &Matrix1::new(value));
                }
            }
            for t in [&mut sparse, &mut full] {
                if i < 2 * n / 5 {
                    t.noise_trapezoid(slots[i], slots[i], &Matrix1::new(1e-3));
                } else {
                    t.noise(slots[i], slots[i], &Matrix1::new(1e-4));
                }
            }
        }
        let mut jacobian = Jacobian::new(&layout, ROWS);
        jacobian.reset(ROWS);
        for k in 0..6 {
            let column: nalgebra::SMatrix<f64, ROWS, 1> = nalgebra::SMatrix::from_fn(|_, _| random.signed());
            jacobian.add(0, &Quantity::State(slots[k * (n - 1) / 5]), &column);
        }
        let a = DMatrix::from_fn(n, n, |_, _| random.signed() / (n as f64).sqrt());
        let start = &a * a.transpose() + DMatrix::identity(n, n);
        Self {
            n,
            sparse,
            full,
            jacobian,
            noise: [0.5, 0.0, 0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 0.9],
            start: start.as_slice().to_vec(),
        }
    }
}

/// A form at work on a problem.
struct Bench<'a> {
    problem: &'a Problem,
    form: Arc<dyn Form>,
    start: Vec<f64>,
    p: Vec<f64>,
    work: Workspace,
}

impl<'a> Bench<'a> {
    fn new(problem: &'a Problem, form: Arc<dyn Form>) -> Self {
        let n = problem.n;
        let mut start = vec![0.0; form.storage(n)];
        form.set_block(n, &mut start, 0..n, &problem.start);
        Self {
            problem,
            p: start.clone(),
            start,
            work: Workspace::new(form.as_ref(), n, ROWS),
            form,
        }
    }

    fn predict(&mut self, t: &Transition) {
        self.p.copy_from_slice(&self.start);
        assert!(self.form.predict(self.problem.n, &mut self.p, t, &mut self.work));
    }

    fn update(&mut self) {
        let (n, h, r) = (self.problem.n, &self.problem.jacobian, &self.problem.noise);
        self.p.copy_from_slice(&self.start);
        self.form.project(n, &self.p, h, &mut self.work);
        let w = &mut self.work;
        (0..ROWS * ROWS).for_each(|k| w.s[k] = w.hph[k] + r[k]);
        assert!(cholesky(&w.s, &mut w.l, ROWS));
        w.gain(ROWS);
        self.form.condition(n, &mut self.p, h, r, w);
        assert!(self.form.is_positive(n, &self.p, &mut self.work));
    }

    fn dense(&self) -> DMatrix<f64> {
        let n = self.problem.n;
        DMatrix::from_fn(n, n, |i, j| self.form.element(n, &self.p, i, j))
    }
}

/// Every form must give the result of Joseph's form.
fn agree(problem: &Problem) {
    let results = forms().map(|(name, form)| {
        let mut bench = Bench::new(problem, form);
        let mut after = |work: &dyn Fn(&mut Bench<'_>)| {
            work(&mut bench);
            bench.dense()
        };
        (
            name,
            [
                after(&|b| b.predict(&problem.sparse)),
                after(&|b| b.predict(&problem.full)),
                after(&|b| b.update()),
            ],
        )
    });
    for (name, result) in &results {
        for (found, wanted) in result.iter().zip(&results[0].1) {
            // 1e-12: sums of up to 300 products of numbers around one.
            assert!((found - wanted).amax() < 1e-12 * problem.n as f64, "{name}, n = {}", problem.n);
        }
    }
}

/// The update as one dense QR of [[R^½, HS], [0, S]], by `faer`. It shows how much time the rotations save.
fn array_by_faer(problem: &Problem, root: &[f64]) -> Mat<f64> {
    let (n, ld) = (problem.n, root.len() / problem.n);
    let (h, r) = (&problem.jacobian, &problem.noise);
    let array = Mat::from_fn(ROWS + n, ROWS + n, |k, column| match (k < ROWS, column < ROWS) {
        (true, true) if k == column => r[k * (ROWS + 1)].sqrt(),
        (true, _) => 0.0,
        (false, true) => (0..=k - ROWS).map(|i| h.row(column)[i] * root[(k - ROWS) * ld + i]).sum(),
        (false, false) => root[(k - ROWS) * ld + column - ROWS],
    });
    array.qr().thin_R().to_owned()
}

type Work<'a> = (&'static str, Box<dyn FnMut() + 'a>);

/// The works to time at one size, group by group.
fn works<'a>(problem: &'a Problem) -> Vec<(&'static str, Vec<Work<'a>>)> {
    let each = |work: fn(&mut Bench<'a>)| {
        let of = move |(name, form): (&'static str, Arc<dyn Form>)| -> Work<'a> {
            let mut bench = Bench::new(problem, form);
            (name, Box::new(move || work(black_box(&mut bench))))
        };
        forms().into_iter().map(of).collect::<Vec<_>>()
    };
    let mut update = each(Bench::update);
    update.pop();
    let root = Bench::new(problem, Arc::new(SquareRoot::default())).start;
    update.push((
        "square_root, faer",
        Box::new(move || drop(black_box(array_by_faer(problem, &root)))),
    ));
    let n = problem.n;
    let (phi, p) = (
        DMatrix::from_fn(n, n, |i, j| problem.full.phi.get(i, j)),
        DMatrix::from_column_slice(n, n, &problem.start),
    );
    let (phi_f, p_f) = (Mat::from_fn(n, n, |i, j| phi[(i, j)]), Mat::from_fn(n, n, |i, j| p[(i, j)]));
    let product: Vec<Work<'a>> = vec![
        ("nalgebra", Box::new(move || drop(black_box(&phi * &p * phi.transpose())))),
        ("faer", Box::new(move || drop(black_box(&phi_f * &p_f * phi_f.transpose())))),
    ];
    vec![
        ("form/predict/sparse", each(|b| b.predict(&b.problem.sparse))),
        ("form/predict/full", each(|b| b.predict(&b.problem.full))),
        ("form/update", update),
        ("form/product", product),
    ]
}

/// The least time of each work. The works run in turns.
fn least(works: &mut [Work<'_>]) -> Vec<Duration> {
    let mut least = vec![Duration::MAX; works.len()];
    let clock = Instant::now();
    let turns = if once::is_test() { 1 } else { 500 };
    for turn in 0..turns {
        if turn > 5 && clock.elapsed() > Duration::from_secs(2) {
            break;
        }
        for (least, (_, work)) in least.iter_mut().zip(works.iter_mut()) {
            let clock = Instant::now();
            work();
            *least = (*least).min(clock.elapsed());
        }
    }
    least
}

fn benches(c: &mut Criterion) {
    faer::set_global_parallelism(faer::Par::Seq);
    let mut tables: Vec<(&str, Table)> = Vec::new();
    // Φ of 300 states is written element by element, which takes minutes.
    let sizes = if once::is_test() { &SIZES[..5] } else { &SIZES };
    for &n in sizes {
        let problem = Problem::new(n);
        agree(&problem);
        for (k, (group, mut works)) in works(&problem).into_iter().enumerate() {
            let mut criterion_group = c.benchmark_group(group);
            for (name, work) in &mut works {
                criterion_group.bench_function(BenchmarkId::new(*name, n), |b| b.iter(&mut *work));
            }
            criterion_group.finish();
            if tables.len() == k {
                let mut table = Table::new();
                table.load_preset(comfy_table::presets::ASCII_MARKDOWN);
                table.set_header(["n, µs"].into_iter().chain(works.iter().map(|w| w.0)));
                tables.push((group, table));
            }
            let times = least(&mut works).into_iter().map(|d| format!("{:.1}", d.as_secs_f64() * 1e6));
            tables[k].1.add_row([n.to_string()].into_iter().chain(times));
        }
    }
    for (group, table) in tables {
        println!("\n{group}\n{table}");
    }
}

criterion_group! {
    name = all;
    config = Criterion::default().sample_size(10).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_millis(500));
    targets = benches
}
criterion_main!(all);
