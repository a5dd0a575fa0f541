//! A study's log on its way to a motion: with the format, the filters and the commanded motion that the study names for it.

use crate::error::Error;
use crate::machine::Machine;
use crate::study::Study;
use dynident_recording::{FilterError, Log, MotionSettings, MotionStream, RecordingError, Reference};
use std::path::Path;
use std::sync::Arc;

/// Opens log number `index`, whose file is `file`.
///
/// # Errors
/// What reading the log and its reference can give.
pub(crate) fn motion_stream(
    study: &Study,
    machine: &Machine,
    motion: &MotionSettings,
    index: usize,
    file: &Path,
) -> Result<MotionStream, Error> {
    let failed = |source| Error::recording(&study.log_name(index), source);
    let reference = reference(study, machine, motion, index)?;
    let log = Log::file(file, study.format_of(index), &machine.log_joints);
    MotionStream::following(&log, motion, reference.as_ref()).map_err(failed)
}

/// The commanded motion of a log, its joints in the order of the log's columns; `None` for differentiators that need none.
fn reference(
    study: &Study,
    machine: &Machine,
    motion: &MotionSettings,
    index: usize,
) -> Result<Option<Arc<Reference>>, Error> {
    if motion.differentiator.reference().is_none() {
        return Ok(None);
    }
    // The differentiator says that it needs one.
    let Some(reference) = commanded(study, machine, motion, index)? else { return Ok(None) };
    let mut order = vec![0; machine.model().dof()];
    for (joint, &place) in machine.log_place.iter().enumerate() {
        order[place] = joint;
    }
    Ok(reference.reordered(&order).map(Arc::new))
}

/// The motion that was commanded in a log, its joints in the model's order: the log's own `reference`, or the differentiator's; `None` if neither is given.
///
/// # Errors
/// What reading it can give, and one for another number of joints.
pub(crate) fn commanded(
    study: &Study,
    machine: &Machine,
    motion: &MotionSettings,
    index: usize,
) -> Result<Option<Reference>, Error> {
    let own = study.log[index].reference.as_ref();
    let Some(settings) = own.or_else(|| motion.differentiator.reference()) else { return Ok(None) };
    let failed = |source| Error::recording(&study.log_name(index), source);
    let filter = |source| failed(RecordingError::Filter(source));
    let dof = machine.model().dof();
    let reference = match (&settings.file, settings.closed_form().map_err(filter)?) {
        (_, Some(closed)) => closed,
        (Some(file), None) => {
            let path = machine.folders.find(file, study.source.as_deref())?;
            settings.placed(Reference::read(&path, dof).map_err(failed)?).map_err(filter)?
        }
        (None, None) => return Ok(None),
    };
    let found = reference.joints();
    if found != dof {
        let problem = format!("it moves {found} joints, the robot has {dof}: give one for each, in the robot's order");
        return Err(filter(FilterError::Reference { problem }));
    }
    Ok(Some(reference))
}
