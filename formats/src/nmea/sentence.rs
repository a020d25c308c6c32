//! One sentence: its address, its fields, its checksum.

/// A sentence without its mark and its checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sentence<'a> {
    /// Talker and type: `GNGGA`.
    pub(crate) address: &'a str,
    body: &'a [u8],
}

/// Letters of the longest address: `PUBX00` and others of manufacturers have more than five.
const LONGEST_ADDRESS: usize = 8;

impl<'a> Sentence<'a> {
    /// The address of a line that begins with `$`, if it has one.
    pub(crate) fn address(line: &'a [u8]) -> Option<&'a str> {
        let body = line.strip_prefix(b"$")?;
        let end = body.iter().position(|byte| !byte.is_ascii_alphanumeric())?;
        let is_address = (3..=LONGEST_ADDRESS).contains(&end) && body[end] == b',';
        core::str::from_utf8(&body[..end]).ok().filter(|_| is_address)
    }

    /// Reads a line that begins with `$`.
    pub(crate) fn of(line: &'a [u8]) -> Result<Self, String> {
        let address = Self::address(line).ok_or("it has no address")?;
        let end = line.iter().rposition(|byte| *byte == b'*').ok_or("it has no checksum")?;
        let body = &line[1..end];
        let told = line.get(end + 1..end + 3).and_then(|digits| core::str::from_utf8(digits).ok());
        let told = told
            .and_then(|digits| u8::from_str_radix(digits, 16).ok())
            .ok_or("its checksum is no number")?;
        let own = body.iter().fold(0, |sum, byte| sum ^ byte);
        if own != told {
            return Err(format!("its checksum is {told:02X}, that of its content is {own:02X}"));
        }
        Ok(Self {
            address,
            body: &body[address.len() + 1..],
        })
    }

    /// Its type: `GGA` of `GNGGA`. The address of a manufacturer's sentence has no talker.
    pub(crate) fn kind(address: &str) -> &str {
        match address.as_bytes() {
            [b'P', ..] => address,
            _ => address.get(2..).unwrap_or(address),
        }
    }

    /// Its fields.
    pub(crate) fn fields(&self) -> impl Iterator<Item = &'a [u8]> + Clone {
        self.body.split(|byte| *byte == b',')
    }
}
