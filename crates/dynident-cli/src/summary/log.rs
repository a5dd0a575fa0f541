use super::text::{end_of_name, table, wrapped};
use core::fmt::Write;
use dynident::result::{LogChannel, LogContents};

/// Maximum number of channels shown per group; the JSON output contains all.
const MAX_SHOWN: usize = 64;
const MAX_NAME_COLUMNS: usize = 34;
/// Number of characters in which the values of a channel are shown over time.
const COURSE_COLUMNS: usize = 16;

/// A recording: its groups, their channels with range and values over time, and a suggested `[format]` for a study.
pub(crate) fn log(found: &LogContents) -> String {
    let mut text = wrapped(
        &format!("{}: {}, {} bytes, {} channels", found.file, found.format, found.bytes, found.channels.len()),
        2,
    );
    for (index, group) in found.groups.iter().enumerate() {
        let mut line = group.name.as_ref().map_or_else(String::new, |name| format!("{name}: "));
        let _ = write!(line, "{} rows", group.rows);
        if let (Some(time), Some(span), Some(rate)) = (&group.time, group.span_s, group.rate_hz) {
            let _ = write!(line, ", {span:.3} s at {rate:.2} Hz by {time}");
        } else {
            line += ", no clock was recognised";
        }
        text.push('\n');
        text += &wrapped(&line, 2);
        // All episodes have the same channels as the first one, so they are shown only once.
        if index > 0 && found.has_episodes() {
            continue;
        }
        let channels: Vec<&LogChannel> = found.channels.iter().filter(|channel| channel.group == index).collect();
        // The topic is shown in the line above, so it is removed from the name of the channel.
        let topic = group.name.as_ref().map_or_else(String::new, |name| format!("{name}."));
        let rows = channels.iter().take(MAX_SHOWN).map(|channel| {
            let name = channel.name.strip_prefix(&topic).unwrap_or(&channel.name);
            let [low, high] = channel.range.map_or(["-".to_owned(), "-".to_owned()], |range| range.map(shown));
            vec![
                end_of_name(name, MAX_NAME_COLUMNS),
                channel.unit.clone().unwrap_or_default(),
                low,
                high,
                if channel.missing > 0 { channel.missing.to_string() } else { String::new() },
                course(channel),
            ]
        });
        let header = ["channel", "unit", "lowest", "highest", "missing", "course"].map(str::to_owned);
        text += &table(&header, 2..5, rows.collect());
        if channels.len() > MAX_SHOWN {
            let _ = writeln!(text, "  and {} more", channels.len() - MAX_SHOWN);
        }
    }
    if let Some(place) = &found.truncated {
        text += &wrapped(&format!("\nthe file is truncated after {place}"), 2);
    }
    for note in &found.notes {
        text += &wrapped(&format!("  not read: {note}"), 4);
    }
    text += "\nsuggested begin of a study:\n\n";
    text += &found.study_format;
    text
}

fn shown(value: f64) -> String {
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        return format!("{value:.4}");
    }
    format!("{value:.2e}")
}

/// The values of a channel over time, between its lowest and highest mean, as a line of bars; blank for missing
/// values.
fn course(channel: &LogChannel) -> String {
    const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let values = channel.course.iter().flatten();
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    let count = channel.course.len();
    let bar = |sign: usize| {
        // Each character shows the middle one of the parts that it covers.
        let part = channel.course[(2 * sign + 1) * count / (2 * count.min(COURSE_COLUMNS))];
        part.map_or(' ', |value| {
            let share = if high > low { (value - low) / (high - low) } else { 0.0 };
            BARS[((share * 8.0) as usize).min(7)]
        })
    };
    (0..count.min(COURSE_COLUMNS)).map(bar).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_course_is_drawn_between_its_ends() {
        let course_of = |values: &[Option<f64>]| {
            course(&LogChannel {
                name: String::new(),
                group: 0,
                unit: None,
                rate_hz: None,
                samples: 0,
                missing: 0,
                range: None,
                course: values.to_vec(),
            })
        };
        assert_eq!(course_of(&[Some(-1.0), None, Some(1.0), Some(0.0)]), "▁ █▅");
        assert_eq!(course_of(&[Some(2.0); 48]), "▁".repeat(16));
        assert_eq!(course_of(&[]), "");
        let ramp: Vec<Option<f64>> = (0..48).map(|k| Some(f64::from(k))).collect();
        assert_eq!(course_of(&ramp), "▁▁▂▂▃▃▄▄▅▅▆▆▇▇██");
    }
}
