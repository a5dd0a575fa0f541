//! The regressor of blocks of samples, one panel per joint: the input of the triangular factors.
//!
//! A joint's row has entries only for the bodies that it moves and for its terms, so each joint has a separate, narrow
//! panel: one column after the other, with one value per sample. The full regressor is never stored.

use crate::regressor::{BlockSink, Entries, regressor_blocks, torque_regressor};
use crate::same_tree::{parents, same_tree};
use crate::sample_lanes::{put_lanes, take_lanes};
use crate::term_history::TermHistory;
use crate::tree_scratch::{TreeBatch, expanded};
use crate::workspace::{AnyScratch, BatchWorkspace, Workspace};
use dynident_lanes::{AlignedBuffer, Kernel, Lane, dispatch};
use dynident_model::terms::{HysteresisState, JointMotion, TermInput, TorqueTerm};
use dynident_model::{INERTIAL_NAMES, JointCoupling, Model};

/// One column of the full regressor: a parameter of the robot.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    /// Parameter `parameter` (index into [`INERTIAL_NAMES`]) of body `body`.
    Body {
        /// The body.
        body: usize,
        /// Index of the parameter, 0 to 9.
        parameter: usize,
    },
    /// The parameter of a term.
    Term(TorqueTerm),
}

impl Column {
    /// Symbol of the parameter, with the body's or joint's number counted from 1: `m2`, `mx2`, `Izz1`, `fv3`.
    pub fn symbol(&self) -> String {
        match self {
            Self::Body { body, parameter } => format!("{}{}", INERTIAL_NAMES[*parameter], body + 1),
            Self::Term(term) => term.symbol(),
        }
    }

    /// Unit of the parameter.
    pub fn unit(&self) -> &str {
        match self {
            Self::Body { parameter: 0, .. } => "kg",
            Self::Body { parameter: 1..=3, .. } => "kg m",
            Self::Body { .. } => "kg m^2",
            Self::Term(term) => term.unit(),
        }
    }
}

/// All columns of a robot: ten per body from base to tip, then the terms.
pub fn all_columns(model: &Model, terms: &[TorqueTerm]) -> Vec<Column> {
    let bodies =
        (0..model.body_count()).flat_map(|body| (0..10).map(move |parameter| Column::Body { body, parameter }));
    bodies.chain(terms.iter().cloned().map(Column::Term)).collect()
}

/// Columns of every joint's panel, and their positions.
#[derive(Clone, Debug)]
pub struct PanelLayout {
    columns: Vec<Column>,
    joints: Vec<JointPanel>,
    /// For each body, bit `k` is set if the layout has its parameter `k`.
    parameters: Vec<u16>,
    /// For each body and each joint on its path: position of the body's first column in that joint's panel.
    places: Vec<usize>,
    /// Start of each body's entries in `places`.
    place_start: Vec<usize>,
    parents: Vec<Option<usize>>,
    coupled: Option<Box<CoupledPanels>>,
}

/// Panels for robots with coupled joints: panels of the tree's joints, and their contributions to the columns of the
/// degrees of freedom.
#[derive(Clone, Debug)]
struct CoupledPanels {
    coupling: JointCoupling,
    /// Columns of the bodies for the tree's joints.
    tree: PanelLayout,
    shares: Vec<ColumnShare>,
}

/// Contribution of a column in the panel of a tree joint to a column in the panel of a degree of freedom.
#[derive(Clone, Copy, Debug)]
struct ColumnShare {
    tree_joint: usize,
    tree_place: usize,
    joint: usize,
    place: usize,
    factor: f64,
}

#[derive(Clone, Debug, Default)]
struct JointPanel {
    columns: Vec<usize>,
    /// Terms: position in the panel, and index of the global column.
    terms: Vec<(usize, usize)>,
}

impl PanelLayout {
    /// Creates the layout for the given columns (a subset of [`all_columns`], in its order).
    ///
    /// # Panics
    /// If a column refers to a body or joint that does not exist, or the bodies' columns are not in ascending order.
    pub fn new(model: &Model, columns: Vec<Column>) -> Self {
        let Some(coupling) = model.coupling() else { return Self::of_tree(model, columns) };
        let is_body = |column: &&Column| matches!(column, Column::Body { .. });
        let bodies: Vec<Column> = columns.iter().take_while(is_body).cloned().collect();
        assert_eq!(bodies.len(), columns.iter().filter(is_body).count(), "bodies' columns stand before those of terms");
        let tree = Self::of_tree(model, bodies);
        let mut joints = vec![JointPanel::default(); model.dof()];
        for (tree_joint, panel) in tree.joints.iter().enumerate() {
            for &(joint, _) in coupling.row(tree_joint) {
                joints[joint].columns.extend(&panel.columns);
            }
        }
        let mut shares = Vec::new();
        for panel in &mut joints {
            panel.columns.sort_unstable();
            panel.columns.dedup();
        }
        for (tree_joint, panel) in tree.joints.iter().enumerate() {
            for &(joint, factor) in coupling.row(tree_joint) {
                shares.extend(panel.columns.iter().enumerate().filter_map(|(tree_place, column)| {
                    let place = joints[joint].columns.binary_search(column).ok()?;
                    Some(ColumnShare { tree_joint, tree_place, joint, place, factor })
                }));
            }
        }
        for (global, column) in columns.iter().enumerate() {
            let Column::Term(term) = column else { continue };
            for joint in term.joints() {
                let panel = &mut joints[joint];
                panel.terms.push((panel.columns.len(), global));
                panel.columns.push(global);
            }
        }
        let coupled = Some(Box::new(CoupledPanels { coupling: coupling.clone(), tree, shares }));
        let parents = parents(model);
        Self { columns, joints, parameters: Vec::new(), places: Vec::new(), place_start: Vec::new(), parents, coupled }
    }

    /// Layout of the joints of the tree without couplings.
    fn of_tree(model: &Model, columns: Vec<Column>) -> Self {
        let count = model.body_count();
        let mut joints = vec![JointPanel::default(); count];
        let paths: Vec<Vec<usize>> = (0..count).map(|body| model.path(body)).collect();
        let mut place_start = vec![0];
        for path in &paths {
            place_start.push(place_start[place_start.len() - 1] + path.len());
        }
        let mut parameters = vec![0_u16; count];
        let mut places = vec![0; place_start[count]];
        let mut last = None;
        for (global, column) in columns.iter().enumerate() {
            match column {
                Column::Body { body, parameter } => {
                    // Columns of a body are consecutive in every panel, so the hot loop needs only the first one.
                    assert!(last < Some((*body, *parameter)), "the columns of bodies ascend");
                    last = Some((*body, *parameter));
                    for (k, &joint) in paths[*body].iter().enumerate() {
                        if parameters[*body] == 0 {
                            places[place_start[*body] + k] = joints[joint].columns.len();
                        }
                        joints[joint].columns.push(global);
                    }
                    parameters[*body] |= 1 << parameter;
                }
                Column::Term(term) => {
                    for joint in term.joints() {
                        let place = joints[joint].columns.len();
                        joints[joint].terms.push((place, global));
                        joints[joint].columns.push(global);
                    }
                }
            }
        }
        Self { columns, joints, parameters, places, place_start, parents: parents(model), coupled: None }
    }

    /// All columns, in global order.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Global indices of the columns of one joint's panel.
    pub fn joint_columns(&self, joint: usize) -> &[usize] {
        &self.joints[joint].columns
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    pub(crate) fn check_tree(&self, model: &Model) {
        assert!(same_tree(&self.parents, model), "the panel layout was made for a model with another tree");
        let coupling = self.coupled.as_ref().map(|coupled| &coupled.coupling);
        assert!(coupling == model.coupling(), "the panel layout was made for a model whose joints follow others");
    }

    /// Combines the panels of the tree joints into those of the degrees of freedom, `Y = Gᵀ Y_tree`.
    fn gather(&self, coupled: &CoupledPanels, tree: &Panels, panels: &mut Panels) {
        let samples = panels.samples;
        for (joint, panel) in self.joints.iter().enumerate() {
            panels.joint_mut(joint)[..(panel.columns.len() - panel.terms.len()) * samples].fill(0.0);
        }
        for share in &coupled.shares {
            let from = &tree.joint(share.tree_joint)[share.tree_place * samples..(share.tree_place + 1) * samples];
            let to = &mut panels.joint_mut(share.joint)[share.place * samples..(share.place + 1) * samples];
            for (to, from) in to.iter_mut().zip(from) {
                *to += share.factor * from;
            }
        }
    }

    /// Layout of the tree's joints. Writes to `room` the derivatives of a cost with respect to their panel entries,
    /// from the derivatives for the degrees of freedom (the adjoint of [`gather`](Self::gather)). `None` without
    /// coupled joints.
    pub(crate) fn scattered<'l>(&'l self, panels: &Panels, room: &mut Panels) -> Option<&'l PanelLayout> {
        let coupled = self.coupled.as_ref()?;
        let samples = panels.samples;
        room.resize(&coupled.tree, samples);
        for panel in &mut room.joints {
            panel.as_mut_slice().fill(0.0);
        }
        for share in &coupled.shares {
            let from = &panels.joint(share.joint)[share.place * samples..(share.place + 1) * samples];
            let start = share.tree_place * samples;
            let to = &mut room.joint_mut(share.tree_joint)[start..start + samples];
            for (to, from) in to.iter_mut().zip(from) {
                *to += share.factor * from;
            }
        }
        Some(&coupled.tree)
    }

    /// Bits of the parameters of `body` that have columns, and the position of the first of these consecutive columns
    /// in the panel of the `k`-th joint on its path.
    #[inline(always)]
    pub(crate) fn body_columns(&self, body: usize, k: usize) -> (u16, usize) {
        (self.parameters[body], self.places[self.place_start[body] + k])
    }
}

/// Panels of one block of samples. Joint `j` has `joint_columns(j).len() + 1` columns of `samples` values, one after
/// the other. The last column is for the joint's torque; the regressor functions do not write it.
#[derive(Debug, Default)]
pub struct Panels {
    samples: usize,
    joints: Vec<AlignedBuffer>,
}

impl Panels {
    pub(crate) fn in_buffers(joints: Vec<AlignedBuffer>) -> Self {
        Self { samples: 0, joints }
    }

    pub(crate) fn into_buffers(self) -> Vec<AlignedBuffer> {
        self.joints
    }

    /// Resizes for `samples` samples of `layout`; memory is reused from block to block.
    pub fn resize(&mut self, layout: &PanelLayout, samples: usize) {
        self.samples = samples;
        self.joints.resize_with(layout.dof(), AlignedBuffer::new);
        for (panel, joint) in self.joints.iter_mut().zip(&layout.joints) {
            panel.resize((joint.columns.len() + 1) * samples);
        }
    }

    /// Number of samples in the block.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// The panel of one joint: regressor columns, then the torque column.
    pub fn joint(&self, joint: usize) -> &[f64] {
        self.joints[joint].as_slice()
    }

    /// The panel of one joint: regressor columns, then the torque column.
    pub fn joint_mut(&mut self, joint: usize) -> &mut [f64] {
        self.joints[joint].as_mut_slice()
    }

    /// The torque column of one joint.
    pub fn torque_mut(&mut self, joint: usize) -> &mut [f64] {
        let panel = self.joints[joint].as_mut_slice();
        let start = panel.len() - self.samples;
        &mut panel[start..]
    }
}

/// Fills the regressor columns of all panels from the motion of a block of samples (joint-major). The torque columns
/// do not change.
///
/// Allocation-free once `panels` has grown to the block's size.
///
/// # Panics
/// If an array's length is not joints × samples, or layout or workspace belong to another tree.
#[doc(alias("regressor", "observation matrix"))]
pub fn regressor_panels(
    model: &Model,
    workspace: &mut BatchWorkspace,
    layout: &PanelLayout,
    motion: &JointMotion<'_>,
    panels: &mut Panels,
) {
    regressor_panels_following(model, workspace, layout, motion, &mut TermHistory::default(), panels);
}

/// Computes [`regressor_panels`](regressor_panels()) of a block that follows earlier blocks of the same recording.
/// `history` provides the state of hysteresis terms, the transmitted torque for load-dependent terms, and
/// temperatures.
/// # Panics
/// As [`regressor_panels`](regressor_panels()), or if the number of load parameters differs from the number of
/// columns. Temperatures are ignored unless there are joints × samples of them.
pub fn regressor_panels_following(
    model: &Model,
    workspace: &mut BatchWorkspace,
    layout: &PanelLayout,
    motion: &JointMotion<'_>,
    history: &mut TermHistory,
    panels: &mut Panels,
) {
    workspace.check(model, motion.samples, &[motion.q, motion.dq, motion.ddq]);
    workspace.check_tree(model);
    layout.check_tree(model);
    panels.resize(layout, motion.samples);
    let BatchWorkspace { level, scratch, tree, .. } = workspace;
    if let Some(coupled) = &layout.coupled {
        let TreeBatch { motion: tree_motion, panels: buffers, .. } = tree;
        let motion = &expanded(&coupled.coupling, motion, tree_motion);
        let mut tree_panels = Panels::in_buffers(core::mem::take(buffers));
        tree_panels.resize(&coupled.tree, motion.samples);
        dispatch(*level, Fill { model, scratch, layout: &coupled.tree, motion, panels: &mut tree_panels });
        layout.gather(coupled, &tree_panels, panels);
        *buffers = tree_panels.into_buffers();
    } else {
        dispatch(*level, Fill { model, scratch, layout, motion, panels });
    }
    fill_terms(layout, motion, history, panels);
}

/// Fills only the columns of terms, like [`regressor_panels_following`]; columns of bodies do not change.
/// Load-dependent terms need the columns of the bodies and are zero here.
///
/// # Panics
/// If an array's length is not joints × samples.
pub fn term_panels_following(
    layout: &PanelLayout,
    motion: &JointMotion<'_>,
    history: &mut TermHistory,
    panels: &mut Panels,
) {
    let numbers = layout.dof() * motion.samples;
    assert!([motion.q, motion.dq, motion.ddq].iter().all(|x| x.len() == numbers), "joints x samples numbers each");
    panels.resize(layout, motion.samples);
    let load_parameters = history.load_parameters.take();
    fill_terms(layout, motion, history, panels);
    history.load_parameters = load_parameters;
}

/// Computes [`regressor_panels_following`] for a single sample. The result is equal up to rounding and takes less
/// than half the time of a block of one sample.
///
/// # Panics
/// As [`regressor_panels_following`], or if the motion has more than one sample.
pub fn regressor_panels_of_sample(
    model: &Model,
    workspace: &mut Workspace,
    layout: &PanelLayout,
    motion: &JointMotion<'_>,
    history: &mut TermHistory,
    panels: &mut Panels,
) {
    assert_eq!(motion.samples, 1, "one sample at a time");
    layout.check_tree(model);
    panels.resize(layout, 1);
    let row_length = 10 * model.body_count();
    let rows = torque_regressor(model, workspace, motion.q, motion.dq, motion.ddq);
    for ((panel, values), row) in layout.joints.iter().zip(&mut panels.joints).zip(rows.chunks_exact(row_length)) {
        for (value, &global) in values.as_mut_slice().iter_mut().zip(&panel.columns) {
            if let Column::Body { body, parameter } = layout.columns[global] {
                *value = row[10 * body + parameter];
            }
        }
    }
    fill_terms(layout, motion, history, panels);
}

/// Fills the columns of terms; the columns of bodies must be filled before.
fn fill_terms(layout: &PanelLayout, motion: &JointMotion<'_>, history: &mut TermHistory, panels: &mut Panels) {
    let samples = motion.samples;
    if history.temperature_c.len() != layout.dof() * samples {
        history.temperature_c.clear();
    }
    for (joint, panel) in layout.joints.iter().enumerate() {
        let mut load_is_known = false;
        for &(place, global) in &panel.terms {
            let Column::Term(term) = &layout.columns[global] else { continue };
            let columns = panels.joint_mut(joint);
            if let (true, false, Some(parameters)) = (term.needs_load(), load_is_known, &history.load_parameters) {
                load_of(&layout.columns, panel, parameters, columns, samples, &mut history.load);
                load_is_known = true;
            }
            if term.has_memory() && history.memories.len() < layout.columns.len() {
                history.memories.resize_with(layout.columns.len(), HysteresisState::default);
            }
            let mut none = HysteresisState::default();
            let memory = history.memories.get_mut(global).unwrap_or(&mut none);
            let temperature_c = history.temperature_c.get(joint * samples..(joint + 1) * samples);
            let mut input = TermInput { load: load_is_known.then_some(&history.load[..]), temperature_c, memory };
            term.column_following(joint, motion, &mut input, &mut columns[place * samples..(place + 1) * samples]);
        }
    }
}

/// Torque of the bodies on one joint, for load-dependent terms.
fn load_of(
    columns: &[Column],
    panel: &JointPanel,
    parameters: &[f64],
    values: &[f64],
    samples: usize,
    load: &mut Vec<f64>,
) {
    assert_eq!(parameters.len(), columns.len(), "one load parameter per column");
    load.clear();
    load.resize(samples, 0.0);
    for (place, &global) in panel.columns.iter().enumerate() {
        if let Column::Body { .. } = columns[global] {
            for (sum, w) in load.iter_mut().zip(&values[place * samples..(place + 1) * samples]) {
                *sum += w * parameters[global];
            }
        }
    }
}

struct Fill<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    layout: &'a PanelLayout,
    motion: &'a JointMotion<'a>,
    panels: &'a mut Panels,
}

impl Kernel for Fill<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { model, scratch, layout, motion, panels } = self;
        let scratch = scratch.of::<T>();
        let samples = motion.samples;
        for group in (0..samples).step_by(T::LANES) {
            // The last group of a block is shifted back over finished samples, so that all groups are full. The
            // finished samples get the same values again.
            let at = group.min(samples.saturating_sub(T::LANES));
            take_lanes(&mut scratch.core.q, motion.q, samples, at);
            take_lanes(&mut scratch.core.dq, motion.dq, samples, at);
            take_lanes(&mut scratch.core.ddq, motion.ddq, samples, at);
            let mut sink = IntoPanels { layout, panels, at, present: 0, places: &[] };
            regressor_blocks(model, &mut scratch.core, &mut scratch.axes, &mut sink);
        }
    }
}

struct IntoPanels<'a> {
    layout: &'a PanelLayout,
    panels: &'a mut Panels,
    at: usize,
    /// Bits of the body's parameters that have columns, and the first columns in the panels of the joints on its
    /// path.
    present: u16,
    places: &'a [usize],
}

impl<T: Lane> BlockSink<T> for IntoPanels<'_> {
    #[inline(always)]
    fn begin(&mut self, body: usize) {
        self.present = self.layout.parameters[body];
        self.places = &self.layout.places[self.layout.place_start[body]..];
    }

    #[inline(always)]
    fn put(&mut self, _body: usize, path: &[u32], bundle: usize, work: &impl Entries<T::Bundle>) {
        // Here the lanes are samples, so a bundle contains one joint.
        let samples = self.panels.samples;
        let present = self.present;
        let start = self.places[bundle] * samples + self.at;
        let mut rest = &mut self.panels.joint_mut(path[bundle] as usize)[start..];
        // Unrolled, because a loop would first write all entries to memory. The torque column follows the last column.
        macro_rules! store {
            ($($parameter:literal)*) => {
                if samples >= T::LANES {
                    $(if present & (1 << $parameter) != 0 {
                        work.of::<$parameter>().store(rest);
                        rest = core::mem::take(&mut rest).get_mut(samples..).unwrap_or_default();
                    })*
                } else {
                    $(if present & (1 << $parameter) != 0 {
                        put_lanes(work.of::<$parameter>(), &mut rest[..samples], 0);
                        rest = core::mem::take(&mut rest).get_mut(samples..).unwrap_or_default();
                    })*
                }
            };
        }
        store!(0 1 2 3 4 5 6 7 8 9);
        let _ = rest;
    }
}
