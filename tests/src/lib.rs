//! Tests of viewfuse. What several of them share lives here.
