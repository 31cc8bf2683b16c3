# Completion for ./moraine in bash:  source completions/moraine.bash
_moraine() {
  local word=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} command='' words='' i d root
  root=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/..
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case ${COMP_WORDS[i]} in
      run | replay | sweep | check | keys | bench | export | import-sphere | watch | figures | movie | view | report | reproduce | cases | docs | test)
        command=${COMP_WORDS[i]}
        break
        ;;
    esac
  done
  case $command in
    '') words="run replay sweep check keys bench export import-sphere watch figures movie view report reproduce cases docs test --help --version --cuda" ;;
    run) words="--resume --force --quiet --set --backend --threads --ranks --help" ;;
    sweep) words="--resume --force --quiet --set --at-once --backend --threads --help" ;;
    check) words="--set --backend --threads --help" ;;
    bench) words="--steps --stage --set --backend --threads --ranks --help" ;;
    watch) words="--interval --once --time --png --no-png --help" ;;
    figures) words="--output --format --only --help" ;;
    movie) words="--only --stage --fps --size --output --help" ;;
    view) words="--stage --every --most --output --help" ;;
    report) words="--output --notes --help" ;;
    reproduce) words="--preset --seeds --quick --set --settled --output --cores --gpu --cluster --cluster-options --dry-run --help" ;;
    export) words="--format --output --help" ;;
    keys) words="--format --help" ;;
    replay) words="--resume --force --quiet --set --backend --threads --help" ;;
    import-sphere | cases) words="--help" ;;
  esac
  case $previous in
    --backend) words="cpu cuda auto" ;;
    --preset) words="paper standard fast" ;;
    --only) if [[ $command == movie ]]; then words="grains section"; else return; fi ;;
    --format) if [[ $command == export ]]; then words="csv lammps vtk"; elif [[ $command == keys ]]; then words="text json"; else return; fi ;;
    --set | --at-once | --threads | --ranks | --steps | --stage | --interval | --fps | --size | --every | --most | --seeds | --cores | --settled) return ;;
  esac
  COMPREPLY=()
  if [[ ! $command || $word == -* || $previous == @(--backend|--preset|--format|--only) ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$words" -S ' ' -- "$word")
  elif [[ $command == @(import-sphere|cases) || $previous == @(--png|--output|--notes) ]]; then
    compopt -o filenames +o nospace
    mapfile -t COMPREPLY < <(compgen -f -- "$word")
  elif [[ $command == reproduce ]]; then  # by name
    for d in "$root"/cases/*/study.toml; do
      d=${d%/study.toml} d=${d##*/}
      [[ $d == '*' || $d != "$word"* ]] || COMPREPLY+=("$d ")
    done
  elif [[ $command == @(run|sweep|check|bench|export|watch|figures|movie|view|report) ]]; then  # directories with a case in them, and those on the way there
    while read -r d; do
      if [[ -e $d/case.toml ]]; then
        COMPREPLY+=("$d ")
      elif compgen -G "$d/*/" >/dev/null; then
        COMPREPLY+=("$d/")
      fi
    done < <(compgen -d -- "$word")
  fi
}
complete -o nospace -F _moraine moraine ./moraine
