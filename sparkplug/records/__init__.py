"""Events of a host session as records of a log: each says by itself what it is, without births or aliases."""
