//! The interface to C: the functions of the library, its header, and two programs that replay rows.

use crate::memory::Needs;
use crate::program::channels;
use fusion::assembly::{Plan, StreamLayout};
use fusion::design::Design;
use fusion::provenance::Provenance;
use std::collections::BTreeSet;

const HEADER: &str = include_str!("fusion.h.txt");
const IN_C: &str = include_str!("replay.c.txt");
const IN_CPP: &str = include_str!("replay.cpp.txt");

/// The files of the interface.
pub(crate) fn files(
    design: &Design,
    plan: &Plan,
    name: &str,
    provenance: &Provenance,
    needs: Option<Needs>,
) -> Vec<(&'static str, String)> {
    let feeds = feeds(plan);
    let exported: String = feeds
        .iter()
        .map(|feed| format!("        {}: {}, {};\n", feed.function, feed.number, feed.stream.width()))
        .collect();
    let hash = &provenance.hash;
    let functions = format!(
        "//! The functions of `fusion.h`.\n\
         \n\
         fusion_abi::export! {{\n    crate::assemble, {hash:?}, {{\n{exported}    }}\n}}\n"
    );
    let declared: String = feeds
        .iter()
        .map(|feed| {
            let (function, stream) = (&feed.function, feed.stream);
            format!(
                "\n/* Stream {} `{}`: {} */\nfusion_status {function}(int64_t time, const double row[{}]);\n",
                feed.number,
                stream.name,
                channels(stream),
                stream.width().max(1)
            )
        })
        .collect();
    // The end of a comment has no place in one.
    let line = design.run.description.lines().next().unwrap_or_default().replace("*/", "* /");
    let header = HEADER
        .replace("@FEEDS@", &declared)
        .replace("@MEMORY@", &memory(needs))
        .replace("@DESCRIPTION@", &line)
        .replace("@VERSION@", &provenance.version)
        .replace("@FILE@", &provenance.design.replace("*/", "* /"))
        .replace("@HASH@", hash);
    let widths: Vec<String> = plan.streams.iter().map(|stream| stream.width().to_string()).collect();
    let most = plan.streams.iter().map(StreamLayout::width).max().unwrap_or(1).max(1);
    let example = |text: &str| {
        text.replace("NAME", &name.replace('-', "_"))
            .replace("WIDTHS", &widths.join(", "))
            .replace("COUNT", &widths.len().to_string())
            .replace("MOST", &most.to_string())
    };
    vec![
        ("src/interface.rs", functions),
        ("fusion.h", header),
        ("examples/replay.c", example(IN_C)),
        ("examples/replay.cpp", example(IN_CPP)),
    ]
}

/// The sizes of the memory, as they are defined in C.
fn memory(needs: Option<Needs>) -> String {
    let Some(Needs { feed, all }) = needs else {
        return "/* The bytes of memory that the filter needs were not measured: `fusion compile --rows` does it. */".to_owned();
    };
    format!(
        "/* The bytes of memory that the filter needs for the rows of `rows.bin`, measured with 64 bits; a processor with 32\n\
         \x20* bits needs less. More rows at a time, as of a faster sensor or of a longer delay, need more: leave a reserve.\n\
         \x20* FUSION_MEMORY_ALL is for programs that call fusion_predict, fusion_checkpoint or fusion_restore. */\n\
         #define FUSION_MEMORY {feed}\n\
         #define FUSION_MEMORY_ALL {all}"
    )
}

/// The function that feeds one stream.
struct Feed<'a> {
    function: String,
    number: usize,
    stream: &'a StreamLayout,
}

/// A function for each stream that comes from outside. If two streams would have one name in C, the later has its number
/// behind it.
fn feeds(plan: &Plan) -> Vec<Feed<'_>> {
    let inside: BTreeSet<usize> = plan.stages.iter().map(|stage| stage.output).collect();
    let mut taken = BTreeSet::new();
    let mut feeds = Vec::new();
    for (number, stream) in plan.streams.iter().enumerate().filter(|(number, _)| !inside.contains(number)) {
        let word: String = stream
            .name
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
            .collect();
        let mut function = format!("fusion_feed_{word}");
        while !taken.insert(function.clone()) {
            function = format!("{function}_{number}");
        }
        feeds.push(Feed { function, number, stream });
    }
    feeds
}
