//! Payloads, drive gains and offsets in `report.html`.

use crate::result::ResultFile;
use dynident_identification::payload::{Measured, PayloadResult};
use dynident_report::{Cell, Heading, Report, Table, Text, Tone, short};

pub(crate) fn loads(page: &mut Report, r: &ResultFile) {
    if !r.payloads.is_empty() {
        page.add(Heading::new("Payloads"));
    }
    for payload in &r.payloads {
        payload_sections(page, payload);
    }
    if let Some(gains) = &r.drive_gains {
        page.add(Heading::new("Drive gains"));
        let rows = gains.iter().map(|gain| {
            let tone = if gain.identified { Tone::Plain } else { Tone::Bad };
            vec![
                Cell::from(&gain.joint),
                Cell::judged(short(gain.gain, 5), tone),
                short(gain.std, 3).into(),
                short(gain.half_width_95, 3).into(),
                gain.reason.clone().unwrap_or_default().into(),
            ]
        });
        let unit = format!("{} per logged unit", r.common_torque_unit());
        let columns = ["joint", &unit[..], "std", "95 %, ±", "reason if not identified"];
        page.add(Table::new("Drive gains", columns).note("factors for torque.scale of the log's format").rows(rows));
    }
    if !r.offsets.is_empty() {
        let rows = r.offsets.iter().map(|offset| {
            vec![
                Cell::from(&offset.joint),
                Cell::from(&offset.log),
                short(offset.deviation_nm, 4).into(),
                short(offset.std_nm, 3).into(),
            ]
        });
        let deviation = format!("deviation from the mean, {}", r.common_torque_unit());
        let table = Table::new("Offsets by log", ["joint", "log", &deviation[..], "std"]);
        page.add(table.note("the base parameters contain the mean over the training logs").rows(rows));
    }
}

fn payload_sections(page: &mut Report, payload: &PayloadResult) {
    let figures = [("mass, kg", payload.mass_kg)]
        .into_iter()
        .chain(["x, m", "y, m", "z, m"].into_iter().zip(payload.com_m))
        .chain(["Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"].into_iter().zip(payload.inertia_at_com_kgm2));
    let possible = payload.possible.as_ref().map(|body| {
        let [x, y, z] = body.com_m;
        let [xx, xy, xz, yy, yz, zz] = body.inertia_at_com_kgm2;
        [body.mass_kg, x, y, z, xx, xy, xz, yy, yz, zz]
    });
    let rows = figures.enumerate().map(|(k, (figure, measured))| {
        let of = |part: fn(&Measured) -> f64| {
            Cell::from(measured.map_or_else(|| "–".to_owned(), |measured| short(part(&measured), 4)))
        };
        let possible = possible.map_or_else(String::new, |values| short(values[k], 4));
        vec![Cell::from(figure), of(|m| m.value), of(|m| m.std), of(|m| m.half_width_95), possible.into()]
    });
    let note = format!(
        "in the frame of {}; inertia (kg m²) about the centre of mass; –: not separately identifiable",
        payload.link
    );
    let columns = ["", "estimate", "std", "95 %, ±", "consistent body"];
    page.add(Table::new(format!("Payload {}", payload.name), columns).note(note).rows(rows));
    let mut text = Text::new(format!("Carried in {}.", payload.logs.join(", ")));
    for words in &payload.not_identified {
        text = text.point(Tone::Warning, words.clone());
    }
    if let Some(reason) = &payload.failure {
        text = text.point(Tone::Bad, format!("no physically consistent body: {reason}"));
    }
    page.add(text);
}
