//! What a robot program uses: ports and remote devices
