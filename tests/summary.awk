# Reads what `cargo test` printed, and from the file `times` what each binary took ("NAME SECONDS USER SYSTEM"), and
# says at the end, one line each, what each binary took, what was ignored and why and what failed; the last line is
# "N passed, N failed, N skipped".

# Which binary speaks: "Running path (target/release/deps/NAME-HASH)", "Doc-tests NAME".
/^ +Running .*\(.*\)$/ { binary = $0; sub(/\)$/, "", binary); sub(/.*[\/\\]/, "", binary); sub(/-[0-9a-f]+(\.exe)?$/, "", binary) }
/^ +Doc-tests / { binary = "doc-tests of " $2 }

# "test NAME ... ignored, REASON" and "test [REASON] NAME ... ignored".
/^test .* \.\.\. ignored/ {
  name = $0; sub(/^test +/, "", name)
  reason = name; sub(/.* \.\.\. ignored,? */, "", reason); sub(/ \.\.\. ignored.*/, "", name)
  if (match(name, /^\[[^]]*\] */)) { reason = substr(name, 2, RLENGTH - 1); sub(/\] *$/, "", reason); name = substr(name, RLENGTH + 1) }
  ignored[++ignored_lines] = "ignored: " binary ": " name (reason == "" ? "" : ": " reason)
}

# The list before a binary's result: "failures:", names that are indented by four blanks, an empty line.
/^failures:$/ { in_failures = 1; next }
in_failures && /^    [^ ]/ { name = $0; sub(/^ +/, "", name); pending[++pending_count] = name; next }
/^---- .* ----$/ { in_failures = 0; pending_count = 0 }

/^test result: / {
  in_failures = 0
  for (i = 1; i <= pending_count; i++) failed[++failed_lines] = "failed: " binary ": " pending[i]
  pending_count = 0
  counted = $0; sub(/^test result: [A-Za-z]+\. /, "", counted)
  split(counted, parts, "; ")
  for (i in parts) { split(parts[i], words, " "); count[words[2]] += words[1] }
  last_failed[binary] = (counted !~ /(^|; )0 failed/)
}

# What cargo lists at the end: "`-p PACKAGE --test NAME`". One without a result, or whose tests all passed, was ended.
/^    `-p .*`$/ {
  name = $0; gsub(/^ +`|`$/, "", name); split("", words); split(name, words, " "); target = words[4]
  if (target == "") { target = words[2]; gsub(/-/, "_", target) }
  if (words[3] == "--doc") target = "doc-tests of " target
  if (!last_failed[target]) { failed[++failed_lines] = "failed: " name ": it ended without a result of its tests"; count["failed"]++ }
}

END {
  if (code != 0 && failed_lines == 0) {
    failed[++failed_lines] = "failed: cargo test, exit code " code ": see above"; count["failed"]++
  }
  print "\n== summary"
  while ((getline line < times) > 0) {
    split(line, words, " ")
    seconds[words[1]] += words[2]; cpu[words[1]] += words[3] + words[4]; all += words[2]; all_cpu += words[3] + words[4]
  }
  # Those that took longer than a second, the longest first.
  while (all > 0) {
    longest = ""
    for (name in seconds) if (seconds[name] >= 1 && (longest == "" || seconds[name] > seconds[longest])) longest = name
    if (longest == "") break
    printf "%6.0f s, %6.0f s of CPU: %s\n", seconds[longest], cpu[longest], longest
    delete seconds[longest]
  }
  if (all > 0) printf "%6.0f s, %6.0f s of CPU: all\n", all, all_cpu
  for (i = 1; i <= ignored_lines; i++) print ignored[i]
  for (i = 1; i <= failed_lines; i++) print failed[i]
  print count["passed"] + 0 " passed, " count["failed"] + 0 " failed, " count["ignored"] + 0 " skipped"
}
