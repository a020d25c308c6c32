//! The truth model: the errors that the simulated world has, each as a scalar that acts on the estimate.

use fusion::assembly::{Assembly, SensorInfo, assemble, declared_streams};
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::{Design, Named, SimulationDesign};
use fusion_core::linear::Transition;
use fusion_core::model::Input;
use fusion_core::state::{Block, Dynamics, Layout, StateRole};
use fusion_models::block::Channel;
use fusion_models::sim::{TriadErrors, UNITS, odometry_channels};
use fusion_models::vocabulary::{channel, parameter, state};

/// A part of the world that brings errors into the estimate.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) name: String,
    /// Its covariance X; `None` if all its errors are drawn once.
    pub(super) block: Option<usize>,
}

/// A scalar error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Error {
    pub(super) source: usize,
    pub(super) ages: Ages,
    pub(super) acts: Acts,
    /// The axis of the state that estimates it.
    pub(super) estimated: Option<usize>,
}

/// How an error changes in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ages {
    /// Drawn once, with this variance.
    Constant(f64),
    /// New with every sample or row: a density in a sample of the input, a 1σ in a row.
    White(f64),
    /// First-order Gauss-Markov: 1σ and correlation time.
    Markov(f64, f64),
    /// Random walk of this density.
    Walk(f64),
}

impl Ages {
    /// Its variance at the start of the world.
    pub(super) fn first(self) -> f64 {
        match self {
            Self::Constant(variance) => variance,
            Self::Markov(sigma, _) => sigma * sigma,
            Self::White(_) | Self::Walk(_) => 0.0,
        }
    }
}

/// Where an error acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Acts {
    /// On a number of the input, times another number of it.
    Input(usize, Times),
    /// On a residual row of a sensor, by its number in the design.
    Row(usize, usize),
    /// On a measurement of a sensor, by its number in the assembly: a column of a factor of its declared R.
    Declared(usize, usize),
    /// On an axis of the state, before the start.
    Axis(usize),
    /// On a block that starts off the truth: the place of the block in the layout, and a column of a factor of its P.
    Start(usize, usize),
    /// The difference between declared values and truth.
    Offset,
}

/// The factor of an error of the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Times {
    One,
    /// A number of the sample.
    Number(usize),
    /// The length of three numbers of the sample.
    Length(usize),
}

impl Times {
    pub(super) fn of(self, sample: &[f64]) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Number(k) => sample[k],
            Self::Length(first) => nalgebra::Vector3::from_column_slice(&sample[first..first + 3]).norm(),
        }
    }
}

/// The own dynamics of a parameter that the world moves: its axis and X.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moved {
    pub(super) axis: usize,
    pub(super) block: usize,
    pub(super) ages: Ages,
}

/// A sensor of the filter, in the world.
#[derive(Clone, Debug)]
pub(super) struct InWorld {
    pub(super) design: usize,
    /// The row of that sensor that its first row is.
    pub(super) first: usize,
    /// The number of the input that each row is, as a stage passes it on; empty for any other sensor.
    pub(super) passed_on: Vec<usize>,
}

/// The errors of the world, and what of it the budget leaves out.
#[derive(Debug)]
pub(super) struct World {
    pub(super) sources: Vec<Source>,
    pub(super) errors: Vec<Error>,
    pub(super) blocks: usize,
    pub(super) moved: Vec<Moved>,
    pub(super) sensors: Vec<InWorld>,
    /// The axis of the bias of a number of the input, where the filter estimates it.
    pub(super) biases: Vec<(usize, usize)>,
    /// For a process driven by time alone: the X of the noise on each axis.
    pub(super) process: Vec<Option<usize>>,
    /// The X of the motion during a gap of the input.
    pub(super) gaps: Option<usize>,
    /// The X of a start that initialisers find from data, and the blocks that they write.
    pub(super) found: Option<(usize, Vec<String>)>,
    /// Blocks that start at a draw about the truth.
    pub(super) drawn: Vec<Block>,
    /// True values of blocks that the design gives.
    pub(super) given: Vec<(Block, Vec<f64>)>,
    /// Blocks whose truth the errors above are.
    pub(super) of_instruments: Vec<Block>,
    pub(super) outside: Vec<String>,
}

impl World {
    /// The world of a simulated design.
    pub(super) fn of(design: &Design, assembly: &Assembly) -> Result<Self, Diagnostics> {
        let simulation = simulated(design)?;
        let mut world = Self {
            sources: Vec::new(),
            errors: Vec::new(),
            blocks: 0,
            moved: Vec::new(),
            sensors: in_world(design, simulation, assembly),
            biases: Vec::new(),
            process: vec![None; assembly.layout.dim()],
            gaps: None,
            found: None,
            drawn: Vec::new(),
            given: Vec::new(),
            of_instruments: Vec::new(),
            outside: Vec::new(),
        };
        world.input(design, simulation, assembly)?;
        world.rows(design, simulation, assembly)?;
        world.parameters(simulation, assembly)?;
        world.start(design, simulation, &assembly.layout);
        world.leave_out(simulation);
        Ok(world)
    }

    fn constant(&mut self, name: impl Into<String>) -> usize {
        let name = name.into();
        self.sources.push(Source { name, block: None });
        self.sources.len() - 1
    }

    fn random(&mut self, name: impl Into<String>) -> usize {
        let source = self.constant(name);
        self.sources[source].block = Some(self.blocks);
        self.blocks += 1;
        source
    }

    /// A source of errors, one for each size above zero: how each ages, and where it acts.
    fn errors(&mut self, name: String, sizes: &[f64], of: impl Fn(usize, f64) -> (Ages, Acts, Option<usize>)) {
        let present: Vec<_> = sizes.iter().enumerate().filter(|(_, size)| **size > 0.0).collect();
        let Some((first, size)) = present.first() else { return };
        let is_constant = matches!(of(*first, **size).0, Ages::Constant(_));
        let source = if is_constant { self.constant(name) } else { self.random(name) };
        self.errors.extend(present.into_iter().map(|(i, size)| {
            let (ages, acts, estimated) = of(i, *size);
            Error {
                source,
                ages,
                acts,
                estimated,
            }
        }));
    }

    /// The errors of the instrument that drives the process; for a process driven by time, its declared noise.
    fn input(&mut self, design: &Design, simulation: &Named<SimulationDesign>, assembly: &Assembly) -> Result<(), Diagnostics> {
        let (world, channels) = (&simulation.block.world, design.process.block.model.input());
        let mut number = 0;
        for read in &channels {
            match (&world.imu, &world.odometry) {
                (Some(unit), _) if *read == channel::ANGULAR_RATE => {
                    let of_states = [state::GYRO_BIAS, state::GYRO_SCALE].map(|name| assembly.layout.block(name.as_str()));
                    self.triad("gyro", &unit.errors()[0], number, of_states);
                }
                (Some(unit), _) if *read == channel::SPECIFIC_FORCE => {
                    let of_states = [state::ACCEL_BIAS, state::ACCEL_SCALE].map(|name| assembly.layout.block(name.as_str()));
                    self.triad("accelerometer", &unit.errors()[1], number, of_states);
                }
                (_, Some(unit)) => {
                    let all = odometry_channels();
                    let density = all
                        .iter()
                        .zip(unit.noise())
                        .find(|(c, _)| *c == read)
                        .map_or(0.0, |(_, density)| density);
                    let name = format!("odometry noise, {}", read.name);
                    self.errors(name, &[density], |_, density| {
                        (Ages::White(density), Acts::Input(number, Times::One), None)
                    });
                }
                _ => {
                    let message = format!(
                        "the process is driven by `{}`, whose errors no simulated instrument declares",
                        read.name
                    );
                    let help = "the budget covers processes that an inertial unit, odometry or time drives";
                    return Err(Diagnostic::error(message).at(design.process.node.name_place()).help(help).into());
                }
            }
            number += read.width;
        }
        let of_unit = |(stream, faults): &(String, Vec<_>)| UNITS.contains(&stream.as_str()) && !faults.is_empty();
        let is_faulty = simulation.block.faults.iter().any(of_unit);
        if channels.is_empty() {
            self.time_driven(assembly);
        } else if is_faulty {
            let source = self.random("motion in gaps of the input, as declared");
            self.gaps = self.sources[source].block;
        }
        Ok(())
    }

    /// The errors of three gyros or accelerometers, whose samples begin at number `first`.
    fn triad(&mut self, name: &str, errors: &TriadErrors, first: usize, [bias, scale]: [Option<&Block>; 2]) {
        let on = |block: Option<&Block>, i: usize| block.map(|b| b.tangent + i);
        self.biases.extend((0..3).filter_map(|i| Some((first + i, on(bias, i)?))));
        let one = |i: usize| Acts::Input(first + i, Times::One);
        let all = |what: &str| format!("{name} {what}");
        self.errors(all("bias"), &errors.bias, |i, s| (Ages::Constant(s * s), one(i), on(bias, i)));
        self.errors(all("slow error"), &errors.markov, |i, s| {
            (Ages::Markov(s, errors.tau), one(i), on(bias, i))
        });
        self.errors(all("bias random walk"), &errors.walk, |i, s| (Ages::Walk(s), one(i), on(bias, i)));
        self.errors(all("noise"), &errors.noise, |i, s| (Ages::White(s), one(i), None));
        self.errors(all("scale factor"), &errors.scale, |i, s| {
            (
                Ages::Constant(s * s),
                Acts::Input(first + i, Times::Number(first + i)),
                on(scale, i),
            )
        });
        self.errors(all("scale noise"), &[errors.scale_noise; 3], |i, s| {
            (Ages::White(s), Acts::Input(first + i, Times::Length(first)), None)
        });
        // Each axis towards both others.
        let pairs = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)];
        self.errors(all("misalignment"), &pairs.map(|(i, _)| errors.misalignment[i]), |k, s| {
            let (i, j) = pairs[k];
            (Ages::Constant(s * s), Acts::Input(first + i, Times::Number(first + j)), None)
        });
        if errors.resolution.iter().any(|step| *step > 0.0) {
            self.outside.push(format!("the resolution of the {name}"));
        }
        self.of_instruments.extend([bias, scale].into_iter().flatten().cloned());
    }

    /// The noise of a process without input, as declared: a source for each group of blocks that it couples.
    fn time_driven(&mut self, assembly: &Assembly) {
        let layout = &assembly.layout;
        let mut step = Transition::new(layout);
        assembly.process.linearise(layout.initial(), &Input::held(&[]), 0.1, &mut step);
        let coupled: Vec<_> = step.noise_before().chain(step.noise_after()).map(|(i, j, _)| (i, j)).collect();
        let at = |axis: usize| layout.blocks().iter().position(|b| b.tangent_range().contains(&axis));
        let mut group: Vec<usize> = (0..layout.blocks().len()).collect();
        for (a, b) in coupled.iter().filter_map(|(i, j)| Some((at(*i)?, at(*j)?))) {
            let (from, to) = (group[a].max(group[b]), group[a].min(group[b]));
            group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
        }
        let is_noisy = |k: usize| coupled.iter().any(|(i, _)| at(*i) == Some(k));
        for first in (0..group.len()).filter(|k| group[*k] == *k) {
            let blocks = layout
                .blocks()
                .iter()
                .enumerate()
                .filter(|(k, _)| group[*k] == first && is_noisy(*k));
            let blocks: Vec<&Block> = blocks.map(|(_, block)| block).collect();
            if blocks.is_empty() {
                continue;
            }
            let names: Vec<&str> = blocks.iter().map(|b| b.name.as_str()).collect();
            let source = self.random(format!("process noise of {}, as declared", names.join(", ")));
            let block = self.sources[source].block;
            blocks.iter().for_each(|b| self.process[b.tangent_range()].fill(block));
        }
        // Noise that depends on the state, or that the step above does not have.
        if let Some(rest) = self.process.iter().position(|block| block.is_none()) {
            let source = self.random("process noise, unlabelled");
            let block = self.sources[source].block;
            self.process[rest..]
                .iter_mut()
                .filter(|own| own.is_none())
                .for_each(|own| *own = block);
        }
    }

    /// The errors of measurements.
    fn rows(&mut self, design: &Design, simulation: &Named<SimulationDesign>, assembly: &Assembly) -> Result<(), Diagnostics> {
        for (number, named) in design.sensors.iter().enumerate() {
            let (name, read) = (&named.name, named.block.model.reading());
            if read.channels().is_empty() {
                continue;
            }
            let rows = named.block.model.noise();
            let Some(simulated) = simulation.block.world.sensor.get(name) else {
                self.declared(name, number, assembly);
                continue;
            };
            let errors = simulated
                .errors(&rows)
                .map_err(|e| simulation.node.locate(&e.within(format!("sensor.{name}"))))?;
            let own = assembly.layout.block(format!("{name}.{}", parameter::BIAS));
            let own = own.filter(|b| b.kind.storage() == rows.len() && rows.iter().all(|row| row.to_string() == b.unit));
            let (on, act) = (|i: usize| own.map(|b| b.tangent + i), |i: usize| Acts::Row(number, i));
            self.errors(format!("{name} noise"), &errors.white, |i, s| (Ages::White(s), act(i), None));
            self.errors(format!("{name} slow error"), &errors.markov, |i, s| {
                (Ages::Markov(s, errors.tau), act(i), on(i))
            });
            self.errors(format!("{name} bias"), &errors.bias, |i, s| (Ages::Constant(s * s), act(i), on(i)));
            if errors.resolution.iter().any(|step| *step > 0.0) {
                self.outside.push(format!("the resolution of `{name}`"));
            }
        }
        Ok(())
    }

    /// A sensor that reads another instrument or a stage: its noise as the filter declares it.
    fn declared(&mut self, name: &str, design: usize, assembly: &Assembly) {
        let source = self.random(format!("{name} noise, as declared"));
        let own = assembly.sensors.iter().enumerate().filter(|(_, info)| info.design == design);
        for (sensor, info) in own {
            self.errors.extend((0..info.model.size().residual).map(|column| Error {
                source,
                ages: Ages::White(1.0),
                acts: Acts::Declared(sensor, column),
                estimated: None,
            }));
        }
    }

    /// The parameters that the world draws, and those whose true value is given.
    fn parameters(&mut self, simulation: &Named<SimulationDesign>, assembly: &Assembly) -> Result<(), Diagnostics> {
        let SimulationDesign { world, truth, .. } = &simulation.block;
        let layout = &assembly.layout;
        let given = truth.as_ref().map_or(&[][..], |truth| &truth.given[..]);
        if let Some(truth) = truth {
            let of_truth = assemble(&truth.design, declared_streams(&truth.design)?)?.layout;
            for name in given {
                match (layout.block(name), of_truth.block(name)) {
                    (Some(own), Some(true_one)) => {
                        let value = of_truth.initial()[true_one.storage_range()].to_vec();
                        self.given.push((own.clone(), value));
                    }
                    _ => self.outside.push(format!("the true `{name}`, which is no state of the filter")),
                }
            }
        }
        let of_vehicle = layout
            .blocks()
            .iter()
            .filter_map(|block| Some((block.clone(), vec![world.true_slip(block)?])));
        self.given.extend(of_vehicle);
        let read_elsewhere = |block: &Block| {
            let own = assembly.sensors.iter().find(|info| info.name == block.owner);
            own.is_some_and(|info| !info.channels.is_empty() && !world.sensor.contains_key(&info.name))
        };
        let is_left = |block: &&Block| {
            let is_of_instrument = self.of_instruments.iter().any(|b| b.name == block.name);
            let is_known = is_of_instrument || world.true_slip(block).is_some() || read_elsewhere(block);
            block.role != StateRole::Kinematic && !is_known
        };
        let blocks: Vec<Block> = layout.blocks().iter().filter(is_left).cloned().collect();
        for block in blocks.iter().filter(|_| world.draw_parameters) {
            if !given.contains(&block.name) {
                self.errors(format!("{}, initial", block.name), &block.sigma, |i, s| {
                    (Ages::Constant(s * s), Acts::Axis(block.tangent + i), None)
                });
            }
            let axes = block.tangent_range().enumerate();
            let moved: Vec<(usize, Ages)> = match &block.dynamics {
                Dynamics::RandomWalk { psd } | Dynamics::Integral { psd, .. } => {
                    axes.map(|(k, axis)| (axis, Ages::Walk(fusion_core::math::sqrt(psd[k])))).collect()
                }
                Dynamics::GaussMarkov { sigma, tau } => axes.map(|(k, axis)| (axis, Ages::Markov(sigma[k], *tau))).collect(),
                Dynamics::Process | Dynamics::Constant => continue,
            };
            let source = self.random(format!("{}, changes", block.name));
            let own = self.sources[source].block.unwrap_or(0);
            self.moved
                .extend(moved.into_iter().map(|(axis, ages)| Moved { axis, block: own, ages }));
        }
        Ok(())
    }

    /// The errors at the start.
    fn start(&mut self, design: &Design, simulation: &Named<SimulationDesign>, layout: &Layout) {
        let from_data = design.initialisers.iter().filter(|i| !i.block.inputs().is_empty());
        let found: Vec<String> = from_data.flat_map(|i| i.block.writes()).map(str::to_owned).collect();
        for (place, block) in layout.blocks().iter().enumerate() {
            let is_drawn = simulation.block.world.draw_start && !found.contains(&block.name);
            if block.role == StateRole::Kinematic && is_drawn {
                let ones = vec![1.0; block.kind.dim()];
                self.errors(format!("start, {}", block.name), &ones, |column, _| {
                    (Ages::Constant(1.0), Acts::Start(place, column), None)
                });
                self.drawn.push(block.clone());
            }
        }
        if !found.is_empty() {
            let source = self.random("start, found from data");
            self.found = self.sources[source].block.map(|block| (block, found));
            let known = "the correlation of a start that is found from data with the errors of the instruments that found it";
            self.outside.push(known.to_owned());
        }
        self.errors("start, declared values off the truth".to_owned(), &[1.0], |_, _| {
            (Ages::Constant(1.0), Acts::Offset, None)
        });
    }

    /// Names what the budget does not cover.
    fn leave_out(&mut self, simulation: &Named<SimulationDesign>) {
        let SimulationDesign { world, faults, .. } = &simulation.block;
        for (stream, faults) in faults {
            let changing = faults.iter().filter(|(_, fault)| fault.outage().is_none());
            self.outside.extend(changing.map(|(name, _)| {
                format!("what the fault `{name}` of `{stream}` does to numbers and stamps: only rows that are missing count")
            }));
        }
        if world.vehicle.as_ref().is_some_and(|vehicle| vehicle.0.mean_slip().is_some()) {
            self.outside
                .push("changes of the slip of the tracks, which the declared noise of their sensor has to cover".to_owned());
        }
        if world.ships().next().is_some() {
            self.outside
                .push("the motion of ships and platforms whose pose is a state".to_owned());
        }
        if world.sea.is_some() {
            self.outside
                .push("changes of the current of the sea, where it is a state".to_owned());
        }
    }
}

/// The simulated world of a design that can have a budget.
pub(super) fn simulated(design: &Design) -> Result<&Named<SimulationDesign>, Diagnostics> {
    let Some(simulation) = &design.simulation else {
        let message = "a budget needs a simulated world, which is its truth: this design reads a log";
        let help = "declare `[simulation]` with a trajectory like that of the log; `fusion blocks` and book/src/simulation.md describe it";
        return Err(Diagnostic::error(message).at(design.document.root().place()).help(help).into());
    };
    if design.filter.bank.is_some() {
        let error = Diagnostic::error("a bank of hypotheses has no budget: its estimate may go over to another hypothesis");
        return Err(error.help("leave out `[filter.bank]`").into());
    }
    Ok(simulation)
}

/// The place of each sensor of the filter in its design.
fn in_world(design: &Design, simulation: &Named<SimulationDesign>, assembly: &Assembly) -> Vec<InWorld> {
    let input = design.process.block.model.input();
    let number = |wanted: &Channel| {
        let at = input.iter().position(|c| c == wanted)?;
        let first: usize = input[..at].iter().map(|c| c.width).sum();
        Some(first..first + wanted.width)
    };
    let mut rows = vec![0; design.sensors.len()];
    let place = |info: &SensorInfo| {
        let (first, m) = (rows[info.design], info.model.size().residual);
        rows[info.design] += m;
        let is_simulated = simulation.block.world.sensor.contains_key(&design.sensors[info.design].name);
        let passed_on: Option<Vec<_>> = info.channels.iter().map(number).collect();
        let passed_on = passed_on.unwrap_or_default().into_iter().flatten().collect::<Vec<_>>();
        InWorld {
            design: info.design,
            first,
            passed_on: if is_simulated || passed_on.len() != m {
                Vec::new()
            } else {
                passed_on
            },
        }
    };
    assembly.sensors.iter().map(place).collect()
}
